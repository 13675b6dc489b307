"""Kistler 9257B dynamometer with charge amplifier through an NI DAQ.

`client.Kistler9257B` meets `drivers.interfaces.Dynamometer`. It opens the DAQ named in the station
file through the local NI-DAQmx driver, or through NI's gRPC device server where `grpc_server` is
set; Reset/Operate is a digital output, or the operator's hand where `reset_line` is null.

`emulator.KistlerEmulator` is such a gRPC device server on loopback; what it leaves out is in its
`does_not_simulate`. calibration: volts to force; daq: all of nidaqmx; explain: its errors in plain
words; timeline: when samples were taken; chain, service, listener: the parts of the emulator.
"""
