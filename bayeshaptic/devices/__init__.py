"""Device files (TOML) and their loader: what is known of a device before it is measured."""

from bayeshaptic.devices.device import STRUCTURES, Device
from bayeshaptic.devices.files import device_from_table, device_names, load_device

__all__ = ["STRUCTURES", "Device", "device_from_table", "device_names", "load_device"]
