"""CPU time of the package beside its peers and beside an older version of itself, in one run.

    python -m benchmarks.peers [--old PATH] [--rounds 5] [--only NAME ...]

PATH is a checkout of the older version.  The peers come with `pip install -e ".[bench]"`; one that
is not there is left out.  Every figure is the least CPU time of some rounds, so that other work on
the machine does not count; compilation is left out.  README.md explains the rows.
"""

from __future__ import annotations

import argparse
import importlib.util
import json
import os
import subprocess
import sys
import warnings
from collections.abc import Callable
from functools import partial
from pathlib import Path

for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
    os.environ.setdefault(variable, "1")

import numpy as np  # noqa: E402

import bayeshaptic as bh  # noqa: E402
from benchmarks.peers.jobs import CASES, DRAWS, JOBS, cpu, drawn, loops, recording  # noqa: E402

HERE = Path(__file__).resolve().parent


def there(module: str) -> bool:
    found = importlib.util.find_spec(module) is not None
    if not found:
        print(f"({module} is not installed: left out)")
    return found


def of_old(path: Path, names: list[str], rounds: int) -> dict[str, float]:
    """The same jobs by another checkout, which knows nothing of this one, in a process."""
    environment = {**os.environ, "PYTHONPATH": f"{path}{os.pathsep}{HERE}"}
    line = [sys.executable, "-c", _OLD, json.dumps(names), str(rounds)]
    done = subprocess.run(
        line, env=environment, check=True, capture_output=True, text=True, cwd=HERE
    )
    return json.loads(done.stdout.splitlines()[-1])


_OLD = """
import json, sys
from jobs import JOBS, cpu
print(json.dumps({name: cpu(JOBS[name](), int(sys.argv[2])) for name in json.loads(sys.argv[1])}))
"""


def response_by_control(model: bh.Model, theta: np.ndarray, hz: np.ndarray) -> np.ndarray:
    """The sampled response by python-control, one vector; its delay rounded to whole periods."""
    import control

    system = model.system(theta[None])
    top, bottom = (polynomial[::-1, 0] for polynomial in system.transfer())
    sampled = control.sample_system(control.tf(top, bottom), model.period_s, "zoh")
    late = np.exp(-2j * np.pi * hz * round(float(system.delay_s[0]) / model.period_s))
    return control.frequency_response(sampled, 2 * np.pi * hz).frdata[0, 0] * late


def response_by_scipy(model: bh.Model, theta: np.ndarray, hz: np.ndarray) -> np.ndarray:
    from scipy import signal

    system = model.system(theta[None])
    top, bottom = (polynomial[::-1, 0] for polynomial in system.transfer())
    b, a, _ = signal.cont2discrete((top, bottom), model.period_s, "zoh")
    _, response = signal.freqz(b.ravel(), a, 2 * np.pi * hz * model.period_s)
    return response


def likelihood_by(respond: Callable[..., np.ndarray], fit: bh.Fit, theta: np.ndarray) -> float:
    """The window's formula around a peer's response, for one vector."""
    windows = fit.windows
    g = respond(fit.model, theta, windows.frequency_hz.ravel()).reshape(windows.frequency_hz.shape)
    left = windows.target - (windows.design @ g[:, :, None])[:, :, 0]
    power = windows.scatter + np.sum(np.abs(left) ** 2, axis=1)
    return float(-np.sum((windows.lines - 1) * np.log(power)))


def likelihoods_by(respond: Callable[..., np.ndarray], fit: bh.Fit, theta: np.ndarray) -> None:
    for row in theta:
        likelihood_by(respond, fit, row)


def likelihood_peers(rounds: int) -> dict[str, float]:
    fit, theta = loops("grasped", 256)
    took = {}
    for module, respond in (("control", response_by_control), ("scipy", response_by_scipy)):
        if there(module):
            took[module] = 256 / 8 * cpu(partial(likelihoods_by, respond, fit, theta[:8]), rounds)
    return took


def limit_peers(rounds: int) -> dict[str, float]:
    """`control.stability_margins` of a few draws of each family, and how many of them are wrong."""
    if not there("control"):
        return {}
    import control

    took = {}
    for name in CASES:
        model, theta = drawn(name, 10)
        wrong: list[bool] = []

        def margins(
            model: bh.Model = model, theta: np.ndarray = theta, wrong: list = wrong
        ) -> None:
            wrong.clear()
            for row in theta:
                system = model.system(row[None])
                top, bottom = (polynomial[::-1, 0] for polynomial in system.transfer())
                late = round(float(system.delay_s[0]) / model.period_s)
                sampled = control.sample_system(control.tf(top, bottom), model.period_s, "zoh")
                delay = control.tf([1], [1] + [0] * late, model.period_s) if late else 1
                gain = control.stability_margins(sampled * delay)[0]
                wrong.append(not confirmed(sampled * delay, gain))

        took[f"limit {name}"] = DRAWS / len(theta) * cpu(margins, 0)
        print(f"  python-control, {name}: {sum(wrong)} of {len(wrong)} margins are wrong")
    return took


def confirmed(loop: object, gain: float) -> bool:
    """Whether the closed loop of python-control's own system is stable below it and not above."""
    if not np.isfinite(gain):
        return False
    top, bottom = np.atleast_1d(loop.num[0][0]), np.atleast_1d(loop.den[0][0])  # type: ignore[attr-defined]

    def radius(k: float) -> float:
        return float(np.max(np.abs(np.roots(np.polyadd(bottom, k * top)))))

    return radius(gain * (1 - 1e-3)) < 1 + 1e-9 and radius(gain * (1 + 1e-3)) > 1


def fit_peers(rounds: int) -> dict[str, float]:
    """40 starts by `scipy.optimize.least_squares` and lmfit on the residuals of this package."""
    from scipy import optimize

    from bayeshaptic.inference.fit import search_box, weighted_residuals
    from bayeshaptic.inference.likelihood import Likelihood
    from benchmarks.peers.jobs import starts

    fit, start = starts()
    here, low, high = search_box(fit.model)
    residuals = weighted_residuals(Likelihood(fit.model, fit.windows), here)
    phi = np.clip(here.coordinate(start), low + 1e-9, high - 1e-9)
    best: dict[str, float] = {}

    def one(x: np.ndarray) -> np.ndarray:
        return np.nan_to_num(residuals(x[None])[0], nan=1e150, posinf=1e150, neginf=-1e150)

    def by_scipy() -> None:
        found = [optimize.least_squares(one, x, bounds=(low, high)).cost for x in phi]
        best["scipy"] = min(found)

    took = {"scipy": cpu(by_scipy, 0)}
    if there("lmfit"):
        import lmfit

        def by_lmfit() -> None:
            found = []
            for x in phi:
                parameters = lmfit.Parameters()
                for i, value in enumerate(x):
                    parameters.add(f"p{i}", value, min=low[i], max=high[i])
                done = lmfit.minimize(
                    lambda p: one(np.array(list(p.valuesdict().values()))), parameters
                )
                found.append(0.5 * done.chisqr)
            best["lmfit"] = min(found)

        took["lmfit"] = cpu(by_lmfit, 0)
    ours = 0.5 * float(np.sum(one(here.coordinate(fit.theta)) ** 2))
    print(
        f"  half chi-square of the best: ours {ours:.2f}, "
        + ", ".join(f"{k} {v:.2f}" for k, v in best.items())
    )
    return took


def etfe_peers(seconds: float, rounds: int) -> dict[str, float]:
    from scipy import signal

    made = recording(seconds)
    rate, u, y = 1 / made.period_s, made.force, made.position
    options = {"fs": rate, "nperseg": 2048}

    def by_scipy() -> None:
        signal.csd(u, y, **options)
        signal.welch(u, **options)
        signal.coherence(u, y, **options)

    took = {"scipy": cpu(by_scipy, rounds)}
    if there("pyFRF"):
        import pyFRF

        def by_pyfrf() -> None:
            estimate = pyFRF.FRF(
                round(rate),
                exc=u,
                resp=y,
                resp_type="d",
                window="hann",
                nperseg=2048,
                noverlap=1024,
            )
            estimate.get_FRF()
            estimate.get_coherence()

        try:
            took["pyFRF"] = cpu(by_pyfrf, rounds)
        except MemoryError:  # it pads each segment to the length of the recording
            print(f"(pyFRF asks for more memory than there is, of {seconds:g} s)")
    return took


def table(name: str, ours: float, others: dict[str, float]) -> None:
    shown = [f"{name:34s} {_seconds(ours)}"]
    shown += [f"{peer} {_seconds(took)} ({took / ours:.1f})" for peer, took in others.items()]
    print("   ".join(shown), flush=True)


def _seconds(value: float) -> str:
    return f"{value:8.3g} s" if value >= 1 else f"{1e3 * value:8.3g} ms"


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--old", type=Path, help="a checkout of an older version")
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--only", nargs="*", choices=JOBS, help="these jobs only")
    asked = parser.parse_args()
    warnings.simplefilter("ignore")  # of the peers
    names = list(asked.only or JOBS)
    old = of_old(asked.old, names, asked.rounds) if asked.old else {}
    limits = limit_peers(asked.rounds) if any(name.startswith("limit") for name in names) else {}
    print("CPU time; in brackets, how many times ours\n")
    for name in names:
        others = {"old": old[name]} if name in old else {}
        if name == "likelihood 256":
            others |= likelihood_peers(asked.rounds)
        elif name in limits:
            others["control"] = limits[name]
        elif name == "fit":
            others |= fit_peers(asked.rounds)
        elif name.startswith("etfe"):
            others |= etfe_peers(3600.0 if "3600" in name else 30.0, asked.rounds)
        table(name, cpu(JOBS[name](), asked.rounds), others)


if __name__ == "__main__":
    main()
