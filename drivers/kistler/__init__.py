"""Kistler 9257B dynamometer with charge amplifier through an NI DAQ (nidaqmx)."""
