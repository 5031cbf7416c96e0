"""The trigger box: protocol, drivers, clock model, fake device, fault proxy.

:mod:`rig.acquisition.trigger.box` is the interface; everything above knows nothing else of a box.
"""
