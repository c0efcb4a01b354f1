"""A methods paragraph to paste, true for this run, with its references as BibTeX."""

from __future__ import annotations

from typing import TYPE_CHECKING

from bayeshaptic.diagnosis.result import Result
from bayeshaptic.quantities import interval, quantity
from bayeshaptic.recordings.checks.sufficiency import told_too_little
from bayeshaptic.report.listed import listed
from bayeshaptic.report.loop.motion_words import motion_words
from bayeshaptic.report.numbers.result import is_unexplained
from bayeshaptic.version import __version__

if TYPE_CHECKING:
    from bayeshaptic.diagnosis.analysis import Analysis
    from bayeshaptic.recordings.response.etfe import Etfe

_BIBTEX = {
    "diaz2010": """@article{diaz2010,
  author = {D{\\'i}az, I{\\~n}aki and Gil, Jorge Juan},
  title = {Influence of Vibration Modes and Human Operator on the Stability of Haptic Rendering},
  journal = {IEEE Transactions on Robotics},
  volume = {26}, number = {1}, pages = {160--165}, year = {2010}
}""",
    "emcee": """@article{emcee,
  author = {Foreman-Mackey, Daniel and Hogg, David W. and Lang, Dustin and Goodman, Jonathan},
  title = {emcee: The {MCMC} Hammer},
  journal = {Publications of the Astronomical Society of the Pacific},
  volume = {125}, number = {925}, pages = {306--312}, year = {2013}
}""",
    "ljung1999": """@book{ljung1999,
  author = {Ljung, Lennart},
  title = {System Identification: Theory for the User},
  publisher = {Prentice Hall}, edition = {2}, year = {1999}
}""",
    "pintelon2012": """@book{pintelon2012,
  author = {Pintelon, Rik and Schoukens, Johan},
  title = {System Identification: A Frequency Domain Approach},
  publisher = {Wiley-IEEE Press}, edition = {2}, year = {2012}
}""",
    "vehtari2021": """@article{vehtari2021,
  author = {Vehtari, Aki and Gelman, Andrew and Simpson, Daniel and Carpenter, Bob
    and B{\\"u}rkner, Paul-Christian},
  title = {Rank-normalization, folding, and localization: an improved $\\widehat{R}$ for assessing
    convergence of {MCMC}},
  journal = {Bayesian Analysis}, volume = {16}, number = {2}, pages = {667--718}, year = {2021}
}""",
    "janot2014": """@article{janot2014,
  author = {Janot, Alexandre and Vandanjon, Pierre-Olivier and Gautier, Maxime},
  title = {A generic instrumental variable approach for industrial robot identification},
  journal = {IEEE Transactions on Control Systems Technology},
  volume = {22}, number = {1}, pages = {132--145}, year = {2014}
}""",
    "kennedy2001": """@article{kennedy2001,
  author = {Kennedy, Marc C. and O'Hagan, Anthony},
  title = {Bayesian calibration of computer models},
  journal = {Journal of the Royal Statistical Society: Series B},
  volume = {63}, number = {3}, pages = {425--464}, year = {2001}
}""",
}


def methods(result: Result) -> str:
    """What was done, in one paragraph with the keys of its references in square brackets."""
    analysis = result.analysis
    if analysis.in_loop is not None:
        return " ".join((_in_loop(analysis), _sampled(analysis), _limit(analysis)))
    if not analysis.sampled:
        return " ".join((*_measured(analysis.etfe), _sampled(analysis)))
    return " ".join(
        (
            *_measured(analysis.etfe),
            _model(analysis),
            _sampled(analysis),
            *_loop(result),
            _limit(analysis),
        )
    )


def bibtex(result: Result) -> str:
    """The references that `methods` names."""
    text = methods(result)
    return "\n\n".join(entry for key, entry in _BIBTEX.items() if f"[{key}]" in text)


def _measured(etfe: Etfe) -> tuple[str, ...]:
    band = interval(*etfe.band_hz, "Hz")
    if etfe.recording is None:
        return (f"The frequency response was given as a table ({band}).",)
    length = quantity(etfe.recording.duration_s, "s")
    rate = quantity(1 / etfe.period_s, "Hz")
    how = (
        "by a local polynomial method [pintelon2012] in windows of neighbouring lines"
        if etfe.period_lines is None
        else f"at the {etfe.period_lines} excited lines of its steady periods"
    )
    if etfe.through_reference:
        how += (
            ", with what of the force the motion does not make (its controller's reference, or its "
            "own innovations) as an instrument"
        )
    if etfe.direct:
        how += (
            ", every line up to the Nyquist frequency counting alike, so that feedback does not "
            "bias the fit (the direct method [ljung1999])"
        )
    found = (
        f"The device's response to a commanded force was recorded for {length} at {rate}, and "
        f"estimated {how} with its noise ({band})."
    )
    leaking = (
        "What leaks, because the record does not end as it began, was taken for the device's own "
        "free motion, with the poles of the fit."
    )
    return (found, leaking) if etfe.leaks_free_motion else (found,)


def _in_loop(analysis: Analysis) -> str:
    recording = analysis.recording
    assert recording is not None
    length = quantity(recording.duration_s, "s")
    words = motion_words(analysis)
    return (
        f"Force and position were recorded for {length} at "
        f"{quantity(1 / recording.period_s, 'Hz')} {words.where}. {words.response} One mass with "
        f"viscous and dry friction, a constant force and a delay, simulated {words.beside}, was "
        f"fitted to the motion ({words.fitted}){_laws(analysis)}."
    )


def _laws(analysis: Analysis) -> str:
    assert analysis.in_loop is not None
    titles = [law.effect.title for law in analysis.in_loop.laws]
    if analysis.in_loop.motion.hums:
        titles.append("tones")
    return f", with {listed(titles)}, which its error called for" if titles else ""


def _model(analysis: Analysis) -> str:
    model = analysis.model
    return (
        f"A mechanism of {model.size} parameters ({model.structure.title}) with an exact "
        "zero-order hold and a fractional loop delay [diaz2010] was fitted to it."
    )


def _sampled(analysis: Analysis) -> str:
    if not analysis.sampled:
        return (
            "The force was computed from the motion, which biases that response. Nothing more was "
            "made of it."
        )
    posterior = analysis.posterior
    ensembles, steps, walkers, _ = posterior.chains.shape
    least = min(posterior.ess_bulk.min(), posterior.ess_tail.min())
    return (
        f"Its posterior was sampled with {ensembles} independent ensembles of {walkers} walkers "
        f"[emcee] for {steps} steps (largest R-hat {posterior.rhat.max():.3f}, at least "
        f"{least:.0f} effective draws a parameter [vehtari2021])."
    )


def _loop(result: Result) -> tuple[str, ...]:
    closed = result.closed
    if closed is None:
        return ()
    found = listed(effect.title for effect in closed.effects)
    count = len(closed.traced.before)
    text = f"The residual was put to {count} tests for effects that the model lacks"
    text += (
        f", and {found} {'was' if len(closed.effects) == 1 else 'were'} added."
        if found
        else "; none was added."
    )
    if is_unexplained(result):
        text += " What remained unexplained widens limit and parameters by a random discrepancy "
        text += "[kennedy2001]."
    return (text,)


def _limit(analysis: Analysis) -> str:
    found = (
        "The critical stiffness is the smallest stiffness at which the sampled loop loses "
        "stability [diaz2010], found for every draw over all crossings of the response."
    )
    if told_too_little(analysis.notices):
        found = "No critical stiffness follows from it."
    return f"{found} The analysis was made with bayeshaptic {__version__}."
