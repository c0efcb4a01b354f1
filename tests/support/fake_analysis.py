"""Stand-ins for an analysis: real models, invented fits and chains, so that reports can be tested
without a sampler, in every shape that an analysis can take."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np

from bayeshaptic.diagnosis.closed import Closed
from bayeshaptic.diagnosis.residuals.moved import moved_besides
from bayeshaptic.diagnosis.residuals.residual import Test
from bayeshaptic.diagnosis.state import Accepted, Estimate, State
from bayeshaptic.diagnosis.traced import Candidate, Traced
from bayeshaptic.errors import Notice
from bayeshaptic.inference.diagnostics import Diagnostics
from bayeshaptic.inference.fit import Fit
from bayeshaptic.inference.posterior import Posterior
from bayeshaptic.models import build_model
from bayeshaptic.models.model import Model
from bayeshaptic.models.response.motion import linear_motion
from bayeshaptic.recordings.recording import Recording
from bayeshaptic.recordings.response.etfe import Etfe, TableSpectra
from bayeshaptic.stability.critical import critical_stiffness
from bayeshaptic.stability.from_etfe import EtfeCriticalStiffness

ENSEMBLES, STEPS, WALKERS = 4, 25, 32


def fake_model(name: str, device: str | None, force_unit: str = "N") -> Model:
    if device is not None:
        return build_model(name, device, delay_sd_s=20e-6)
    known = build_model(name, "lhifam")
    return Model(
        known.structure,
        known.parameters,
        known.fixed,
        1e-3,
        {},
        force_unit=force_unit,
        position_unit="rad" if force_unit != "N" else "m",
    )


class FakeAnalysis(SimpleNamespace):
    """The parts of an `Analysis`, each of which may be changed."""

    closed = None
    effect_names = ()
    analysis = measured = property(lambda self: self)
    declared = property(lambda self: self.limit)
    stated = property(lambda self: self.widened or self.posterior)
    moved_besides = property(lambda self: moved_besides(self.fit, self.etfe.unbroken))
    widened, sampled = None, True


class FakeClosed(SimpleNamespace):
    """The parts of a `Closed`, each of which may be changed."""

    effects, effect_names, force, changing_at_limit, before_like_after = (), (), None, 0.0, None
    may_be_held_by_friction = False
    closed = property(lambda self: self)
    verdict = property(lambda self: self.diagnosis["verdict"])
    measured = property(lambda self: self.base)


def fake_analysis(
    name: str = "grasped",
    device: str | None = "lhifam",
    *,
    force_unit: str = "N",
    spread: float = 0.003,
    damping: float = 0.05,
    misfit: float = 1.0,
    notices: tuple[Notice, ...] = (),
    etfe_limit: bool = True,
    converged: bool = True,
    lever_m: float | None = None,
    title: str = "lhifam-user.csv",
    table: bool = False,
    period_lines: int | None = None,
    seed: int = 3,
) -> Any:
    """One analysis of an invented recording whose truth is the device file.

    Parameters
    ----------
    spread : float
        Posterior sd of a typical log parameter.
    damping : float
        The same of the dampers to the ground.
    misfit : float
        Residual over the noise.
    table : bool
        Without a recording, as from an FRF table.
    period_lines : int, optional
        Excited lines of a periodic excitation.
    """
    rng = np.random.default_rng(seed)
    model = fake_model(name, device, force_unit)
    etfe = replace(_etfe(model, rng, misfit, title, table), period_lines=period_lines)
    posterior = _posterior(model, etfe, rng, spread, damping, converged)
    fit = _fit(model, etfe, posterior, misfit)
    limit = critical_stiffness(posterior)
    middle = limit.quantile(0.5)
    witness = EtfeCriticalStiffness(
        0.985 * middle,
        1.004 * middle,
        1.02 * middle,
        8.7,
        limit.unit,
        phase_sd_deg=0.03,
        db_per_degree=12.0,
    )
    why = "the measured phase does not reach -180 degrees between 0.7 and 300 Hz"
    nothing = EtfeCriticalStiffness(None, None, None, None, limit.unit, why)
    return FakeAnalysis(
        recording=etfe.recording,
        etfe=etfe,
        device=model.device,
        model=model,
        choice=SimpleNamespace(
            model=model,
            fit=fit,
            reason=f"Chosen: {name}, reduced chi-square 1.02.",
            candidates={},
        ),
        fit=fit,
        posterior=posterior,
        limit=limit,
        etfe_limit=witness if etfe_limit else nothing,
        notices=notices,
        seconds={"read": 0.1, "etfe": 0.3, "fit": 0.4, "sample": 1.2},
        noise_scale=fit.reduced_chi_square if misfit > 1.2 else 1.0,
        lever_m=lever_m,
        hidden=None,
        in_loop=None,
    )


def _truth(model: Model) -> Any:
    floor = {"mass": 1e-6, "damping": 1e-3}
    values = build_model(model.name, "lhifam").reference | dict(model.reference)
    dimensions = {p.name: p.dimension for p in model.parameters}
    return np.array([max(values[n], floor.get(dimensions[n], 0.0)) for n in model.names])


def _etfe(model: Model, rng: np.random.Generator, misfit: float, title: str, table: bool) -> Etfe:
    frequency = np.geomspace(0.8, 280.0, 110)
    truth = model.response(_truth(model), frequency)
    sd = np.abs(truth) * 0.006 * (1 + (frequency / 120) ** 2)
    noise = rng.normal(size=(2, len(frequency))) * sd / np.sqrt(2)
    wrong = (misfit - 1) * sd * np.exp(-0.5 * (np.log(frequency / 80) / 0.4) ** 2) * 3
    value = truth + noise[0] + 1j * noise[1] + wrong
    force, rounding = rng.normal(size=30_000), rng.normal(size=30_000) * 1e-6
    motion = linear_motion(model.system(_truth(model)), force, 1e-3)[0]
    recording = Recording(
        force,
        motion + rounding,
        1e-3,
        model.force_unit,
        model.position_unit,
        name=title,
        device=model.device.name if model.device else None,
        user="A" if model.name == "grasped" else None,
    )
    return Etfe(
        frequency,
        value,
        sd**2,
        np.clip(1 - (sd / np.abs(truth)) ** 2 * 12, 0, 1) * np.where(table, np.nan, 1.0),
        1e-3,
        (0.7, 300.0),
        model.force_unit,
        model.position_unit,
        TableSpectra(frequency, value, sd**2, np.full(len(frequency), 60.0)),
        None if table else recording,
    )


def _posterior(
    model: Model, etfe: Etfe, rng: Any, spread: float, damping: float, converged: bool
) -> Posterior:
    truth, size = _truth(model), model.size
    mix = np.eye(size) + rng.normal(size=(size, size)) * 0.5
    mix /= np.sqrt((mix**2).sum(axis=1, keepdims=True))
    normal = rng.normal(size=(ENSEMBLES, STEPS, WALKERS, size)) @ mix.T
    width = np.full(size, spread)
    chains = truth * np.exp(width * normal)
    for i, name in enumerate(model.names):
        if name in ("b", "b1", "b2"):
            chains[..., i] = np.abs(truth[i] * (1 + damping * normal[..., i]))
    ess = 2100 + 900 * rng.uniform(size=size)
    rhat = 1 + 0.002 * rng.uniform(size=size)
    return Posterior(
        model,
        chains,
        -0.5 * (normal**2).sum(axis=-1) + 4000,
        Diagnostics(rhat, ess, 0.98 * ess)
        if converged
        else Diagnostics(rhat + 0.2, ess / 40, ess / 50),
        converged,
        "converged because R-hat between 4 independent ensembles is at most 1.002 and every "
        "parameter has at least 2100 effective draws"
        if converged
        else "not converged: R-hat between 4 independent ensembles is 1.202 for kc",
        seconds=1.23,
        seed=3,
        etfe=etfe,
    )


def _fit(model: Model, etfe: Etfe, posterior: Any, misfit: float) -> Fit:
    theta = _truth(model)
    sd = posterior.draws.std(axis=0)
    outcome = dict.fromkeys(model.names, "converged")
    for name in ("b2", "b"):
        if name in outcome:
            outcome[name] = "at a bound"
            sd[model.names.index(name)] = np.nan
            break
    fitted = model.response(theta, etfe.frequency_hz)
    return Fit(
        model,
        theta,
        np.diag(sd**2),
        outcome,
        float(misfit**2 if misfit > 1 else 1.02),
        4006.0,
        etfe.spectra.windows(),
        etfe.frequency_hz,
        (etfe.value - fitted) / np.sqrt(etfe.variance),
    )


LONG_NAME = (
    "D2_large-haptic-interface-for-aeronautic-maintainability_configuration-with-arm-stretched-out_"
    "user-17_trial-003_excitation-level-high_2026-11-21T07-48-12.csv.gz"
)
FEEDBACK = Notice(
    "warning",
    "feedback",
    "The force was computed from the motion (the force is predictable from past positions, 14 sd): "
    "the response is biased; record with an external excitation.",
)

CASES: dict[str, dict[str, Any]] = {
    "grasped": {},
    "rigid": {"name": "rigid", "spread": 0.001},
    "two-humps": {"name": "free", "spread": 0.01},
    "wide": {"name": "free", "damping": 1.0, "spread": 0.02},
    "phantom-tip": {"device": "phantom", "lever_m": 0.12, "spread": 0.01},
    "no-etfe-limit": {"name": "free", "etfe_limit": False, "spread": 0.02},
    "amperes": {"name": "free", "device": None, "force_unit": "A", "misfit": 13.0, "spread": 1e-3},
    "feedback": {"notices": (FEEDBACK,), "title": LONG_NAME},
    "not-converged": {"converged": False},
    "table": {"table": True, "name": "rigid"},
    "narrow": {"spread": 1e-4},
}


def fake_closed(verdict: str = "explained", family: str = "nonlinear", **options: Any) -> Closed:
    """A closed loop of an invented recording.

    Parameters
    ----------
    verdict : {"consistent", "explained", "unexplained"}
        An unexplained one has found nothing.
    family : {"linear", "nonlinear", "time-varying"}
        Class of the effect that was found, or of what is left.
    options
        Of `fake_analysis`.
    """
    after = fake_analysis("grasped", **options)
    base = fake_analysis("grasped", misfit=1.0 if verdict == "consistent" else 4.0)
    if verdict == "explained":
        base.limit = replace(base.limit, samples=1.66 * base.limit.samples)
    accepted = (_FOUND[family],) if verdict == "explained" else ()
    calm = _tests(1.0)
    loud = _tests(9.0, family)
    candidates = [
        Candidate(e.name, e.title, 300.0 - 200 * n, n == 0 and verdict == "explained", 1)
        for n, e in enumerate((_FOUND[family], *_FOUND.values()))
    ]
    traced = Traced(
        verdict,
        None if verdict == "consistent" else family,
        State(after.etfe, after.fit, accepted),
        calm if verdict == "consistent" else loud,
        loud if verdict == "unexplained" else calm,
        () if verdict == "consistent" else tuple(candidates),
    )
    error = _error(after, 1.02)
    return Closed(
        after if verdict != "explained" else base,
        after,
        traced,
        error if verdict != "explained" else _error(base, 1.6),
        error,
    )


_FOUND = {
    "linear": Accepted(
        "reflex",
        "reflex of the hand",
        "linear",
        "raises the log likelihood of windows it was not fitted to by 120",
        parameters=("kh", "bh"),
        ties=("arm_mode",),
        told_apart_by="another posture or a relaxed grip",
    ),
    "nonlinear": Accepted(
        "coulomb_friction",
        "dry (Coulomb) friction at the motor",
        "nonlinear",
        "raises the log likelihood of windows it was not fitted to by 5323",
        {"friction_force": Estimate(0.5934, 0.0203, "N")},
        limit_log_sd=0.03,
    ),
    "time-varying": Accepted(
        "grip_drift",
        "a grip that changes during the recording",
        "time-varying",
        "letting kh differ between 3 parts of the recording; the limit is that of part 2",
        {
            "kh_last_over_first": Estimate(1.58, float("nan"), ""),
            "bh_last_over_first": Estimate(1.1, float("nan"), ""),
            "worst_part": Estimate(2.0, 0.0, ""),
        },
    ),
}


def _tests(statistic: float, family: str = "") -> tuple[Test, ...]:
    kinds = (("bands", "linear"), ("sign(v)", "nonlinear"), ("a steady change", "time-varying"))
    return tuple(
        Test(
            name,
            kind,
            statistic if kind == family else 1.0,
            4.5,
            87.0 if kind == "linear" else None,
            f"{name} stands {statistic if kind == family else 1.0:.1f} standard deviations out",
        )
        for name, kind in kinds
    )


def _error(analysis: Any, rms: float) -> dict[str, Any]:
    quantiles = {"q05": 0.05, "q50": 0.5, "q95": 0.95}
    return {
        "weighted_rms": rms,
        "held_out_weighted_rms": rms,
        "gain_db_rms": 0.1,
        "phase_deg_rms": 0.8,
        "critical_stiffness": {name: analysis.limit.quantile(p) for name, p in quantiles.items()},
        "critical_stiffness_db": None,
    }
