"""How stiff a virtual wall may be on a haptic device, and how sure of it one can be.

The public names stand in ``__init__.pyi``; each is imported from its module on first use, so that
``import bayeshaptic`` and the command line's help cost nothing::

    import bayeshaptic as bh

    recording = bh.read_recording("lhifam-user.csv")
    etfe = bh.estimate_etfe(recording)
    model = bh.grasped(device="lhifam")
    fit = bh.least_squares(model, etfe)
    posterior = bh.sample(model, etfe, start=fit)
    limit = bh.critical_stiffness(posterior)
    limit.safe(0.01)  # the stiffness with one per cent probability of instability
"""

import lazy_loader

from bayeshaptic.version import __version__ as __version__

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
