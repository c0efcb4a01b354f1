"""The samplers that `sampling.py` runs, and the posterior that it gives to each."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

import bayeshaptic as bh
from bayeshaptic.inference.coordinates import coordinates
from bayeshaptic.inference.sampling.density import Density
from bayeshaptic.rig import Bench, WhiteNoise, simulate

CHAINS, TUNE, DRAWS = 4, 500, 1000  # of NUTS
STEP = 1e-3  # of differences, in standard deviations


@dataclass(frozen=True)
class Target:
    """A posterior in coordinates that are standard normal where it is normal.

    Attributes
    ----------
    recording : Recording
    fit : Fit
    etfe : Etfe
    density : Density
    centre : ndarray, shape (P,)
    root : ndarray, shape (P, P)
        Square root of the covariance.
    """

    recording: bh.Recording
    fit: bh.Fit
    etfe: bh.Etfe
    density: Density
    centre: np.ndarray
    root: np.ndarray

    def __call__(self, x: np.ndarray) -> np.ndarray:
        """Log densities, shape (B,), of points of shape (B, P)."""
        return self.density(self.centre + np.atleast_2d(x) @ self.root.T)

    def with_slope(self, x: np.ndarray) -> tuple[float, np.ndarray]:
        """A log density and its gradient, by central differences."""
        x = np.asarray(x, float)
        moved = STEP * np.eye(len(x))
        value = self(np.concatenate([x[None], x + moved, x - moved]))
        slope = (value[1 : len(x) + 1] - value[len(x) + 1 :]) / (2 * STEP)
        return float(value[0]), np.nan_to_num(slope, posinf=0.0, neginf=0.0)

    def natural(self, x: np.ndarray) -> np.ndarray:
        return self.density.coordinates.natural(self.centre + x @ self.root.T)


def target(device: str, held: bool, with_file: bool) -> Target:
    """The posterior of a simulated recording, 30 s."""
    bench = Bench.from_device(device, held=held)
    noise = WhiteNoise(bench.force_rms, bench.band_hz[1], seconds=30.0)
    made = simulate(bench, noise, seed=1)
    recording = bh.Recording(
        made.force, made.position, made.period_s, encoder_resolution=bench.encoder_resolution
    )
    build = bh.grasped if held else bh.free
    model = build(device=device) if with_file else build(delay_s=bench.delay_s)
    etfe = bh.estimate_etfe(recording)
    fit = bh.least_squares(model, etfe)
    here = coordinates(fit.model)
    stretch = np.where(here.log, fit.theta, here.scale)
    covariance = fit.covariance / np.outer(stretch, stretch)
    unknown = np.isnan(np.diag(covariance))
    covariance[unknown], covariance[:, unknown] = 0.0, 0.0
    covariance += np.diag(np.where(unknown, 1.0, 0.0))
    # What the data do not know the priors do, within a factor of e^3 or so.
    covariance = np.linalg.inv(np.linalg.inv(covariance) + np.eye(len(stretch)) / 9)
    at = here.coordinate(fit.theta[None])[0]
    at = np.where(here.walls, np.maximum(at, here.low + 0.1), at)
    return Target(
        recording, fit, etfe, Density(fit.likelihood, here), at, np.linalg.cholesky(covariance)
    )


def ours(known: Target, seed: int, ess: float) -> np.ndarray:
    """Natural values, shape (chains, draws, P)."""
    found = bh.sample(known.fit.model, known.etfe, start=known.fit, seed=seed, ess=ess)
    return by_walker(found.chains)


def by_walker(chains: np.ndarray) -> np.ndarray:
    """Chains (ensembles, steps, walkers, P), a walker as a chain: (ensembles * walkers, steps, P).

    Walkers one after the other in one chain would look like as many effective draws as draws.
    """
    return np.swapaxes(chains, 1, 2).reshape(-1, chains.shape[1], chains.shape[3])


def by_emcee(known: Target, move: str) -> np.ndarray:
    import emcee

    size, rng = len(known.centre), np.random.default_rng(0)
    moves = {"stretch": emcee.moves.StretchMove(), "DE": emcee.moves.DEMove()}
    sampler = emcee.EnsembleSampler(64, size, known, moves=moves[move], vectorize=True)
    sampler.random_state = np.random.RandomState(0).get_state()
    warm = sampler.run_mcmc(0.1 * rng.standard_normal((64, size)), 1000)
    sampler.reset()
    sampler.run_mcmc(warm, 3000)
    return known.natural(np.swapaxes(sampler.get_chain(), 0, 1))


def by_pints(known: Target) -> np.ndarray:
    import pints

    class Posterior(pints.LogPDF):
        def n_parameters(self) -> int:
            return len(known.centre)

        def __call__(self, x: np.ndarray) -> float:
            return float(known(np.asarray(x))[0])

    rng = np.random.default_rng(0)
    starts = list(0.1 * rng.standard_normal((CHAINS, len(known.centre))))
    np.random.seed(0)  # noqa: NPY002  (PINTS draws from there)
    control = pints.MCMCController(
        Posterior(), CHAINS, starts, np.eye(len(known.centre)), method=pints.HaarioBardenetACMC
    )
    control.set_max_iterations(10_000)
    control.set_log_to_screen(False)
    return known.natural(np.asarray(control.run())[:, 3000:])


def by_nutpie(known: Target) -> np.ndarray:
    import nutpie

    size, rng = len(known.centre), np.random.default_rng(0)
    compiled = nutpie.compiled_pyfunc.from_pyfunc(
        size,
        lambda: known.with_slope,
        lambda *_: lambda x, **__: {"x": np.asarray(x)},
        [np.dtype("float64")],
        [(size,)],
        ["x"],
        make_initial_point_fn=lambda _: 0.1 * rng.standard_normal(size),
    )
    found = nutpie.sample(
        compiled, draws=DRAWS, tune=TUNE, chains=CHAINS, cores=1, seed=1, progress_bar=False
    )
    return known.natural(np.asarray(found.posterior["x"]))


def _in_jax(known: Target) -> Callable[..., object]:
    """The log density as JAX sees it: a call of the compiled one, and of its gradient."""
    import jax
    import jax.numpy as jnp

    jax.config.update("jax_enable_x64", True)
    jax.config.update("jax_cpu_enable_async_dispatch", False)  # a callback would wait for itself
    size = len(known.centre)
    shapes = (jax.ShapeDtypeStruct((), jnp.float64), jax.ShapeDtypeStruct((size,), jnp.float64))

    def called(x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        value, slope = known.with_slope(np.asarray(x))
        return np.asarray(value), slope

    @jax.custom_vjp
    def density(x: object) -> object:
        return jax.pure_callback(called, shapes, x)[0]

    density.defvjp(lambda x: jax.pure_callback(called, shapes, x), lambda slope, g: (g * slope,))
    return density


def by_numpyro(known: Target) -> np.ndarray:
    import jax
    from numpyro.infer import MCMC, NUTS

    density = _in_jax(known)
    start = 0.1 * np.random.default_rng(0).standard_normal((CHAINS, len(known.centre)))
    run = MCMC(
        NUTS(potential_fn=lambda x: -density(x)),
        num_warmup=TUNE, num_samples=DRAWS, num_chains=CHAINS,
        chain_method="sequential", progress_bar=False,
    )  # fmt: skip
    run.run(jax.random.key(0), init_params=jax.numpy.asarray(start))
    return known.natural(np.asarray(run.get_samples(group_by_chain=True)))


def by_blackjax(known: Target) -> np.ndarray:
    import blackjax
    import jax

    density, chains = _in_jax(known), []
    for key in jax.random.split(jax.random.key(0), CHAINS):
        begin, warm, draw = jax.random.split(key, 3)
        start = 0.1 * jax.random.normal(begin, (len(known.centre),))
        adapted, _ = blackjax.window_adaptation(blackjax.nuts, density).run(warm, start, TUNE)
        step = blackjax.nuts(density, **adapted.parameters).step

        def one(state: Any, key: Any, step: Any = step) -> Any:
            state, _ = step(key, state)
            return state, state.position

        _, states = jax.lax.scan(one, adapted.state, jax.random.split(draw, DRAWS))
        chains.append(np.asarray(states))
    return known.natural(np.array(chains))


OLDER = """
import sys, time
import numpy as np
import bayeshaptic as bh
made, model, device, delay, seeds, out = np.load(sys.argv[1]), *sys.argv[2:]
fields = ("period_s", "encoder_resolution")
recording = bh.Recording(made["force"], made["position"], **{f: float(made[f]) for f in fields})
known = {"device": device} if device else {"delay_s": float(delay)}
etfe = bh.estimate_etfe(recording)
fit = bh.least_squares(getattr(bh, model)(**known), etfe)
bh.sample(fit.model, etfe, start=fit, seed=1)  # imports, and what is compiled
found = {}
for seed in range(int(seeds)):
    began = time.process_time()
    found[f"theta{seed}"] = bh.sample(fit.model, etfe, start=fit, seed=seed).chains
    found[f"seconds{seed}"] = time.process_time() - began
np.savez(out, **found)
"""


def by_older(path: str, known: Target, seeds: int) -> list[tuple[np.ndarray, float]]:
    """Natural values, shape (chains, draws, P), and CPU seconds of the version at `path`."""
    one, model = known.recording, known.fit.model
    with tempfile.TemporaryDirectory() as place:
        made, out = os.path.join(place, "made.npz"), os.path.join(place, "out.npz")
        np.savez(
            made, force=one.force, position=one.position, period_s=one.period_s,
            encoder_resolution=one.encoder_resolution,
        )  # fmt: skip
        device = "" if model.device is None else model.device.name
        words = [
            sys.executable,
            "-c",
            OLDER,
            made,
            model.name,
            device,
            str(model.fixed.get("delay_s", 0.0)),
            str(seeds),
            out,
        ]
        subprocess.run(words, env=os.environ | {"PYTHONPATH": path}, cwd=place, check=True)
        found = np.load(out)
        return [
            (by_walker(found[f"theta{seed}"]), float(found[f"seconds{seed}"]))
            for seed in range(seeds)
        ]


SAMPLERS: dict[str, tuple[str, Callable[..., np.ndarray]]] = {
    "bayeshaptic": ("bayeshaptic", ours),
    "emcee, stretch": ("emcee", partial(by_emcee, move="stretch")),
    "emcee, DE": ("emcee", partial(by_emcee, move="DE")),
    "PINTS, adaptive": ("pints", by_pints),
    "nutpie, NUTS": ("nutpie", by_nutpie),
    "NumPyro, NUTS": ("numpyro", by_numpyro),
    "BlackJAX, NUTS": ("blackjax", by_blackjax),
}
