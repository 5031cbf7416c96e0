"""Where should the cameras be? Pure numbers: no files, no devices, no HTTP."""
