"""What can go wrong with a device, in words an operator can act on."""

from __future__ import annotations


class DeviceError(Exception):
    """A device failed: which one, what happened, and what the operator can do about it.

    `device` is the name as the station file gives it, `fault` a sentence without full stop,
    `remedy` an imperative sentence. The text of the exception joins the three.
    """

    def __init__(self, device: str, fault: str, remedy: str) -> None:
        super().__init__(f"{device}: {fault}. {remedy}")
        self.device = device
        self.fault = fault
        self.remedy = remedy


class CannotConnect(DeviceError):
    """The device could not be reached, or did not identify itself, before its deadline."""


class ReadTimeout(DeviceError):
    """The device was there and has fallen silent: its last value is older than its deadline."""


class BadReply(DeviceError):
    """The device answered, and the answer makes no sense or refuses what was asked."""


class NotWanted(DeviceError):
    """What was under way was called off before its end, and has been told to stop."""


class NotDischarged(BadReply):
    """The amplifier was to be in Reset, and its outputs did not fall to zero."""


class OutOfRange(DeviceError):
    """The device says that what it measures lies outside its range."""


class Overload(DeviceError):
    """The amplifier is saturated: its value is no force."""


class SafetyStop(DeviceError):
    """The robot has left its normal safety state, or its program state changed."""
