"""Libraries whose docstrings are left alone, imported without what they bring, compute the same."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

RECORDING = Path(__file__).parents[2] / "data" / "recordings" / "phantom-free.csv.gz"

COMPUTE = """
import matplotlib.figure, numpy as np
from scipy import fft, interpolate, linalg, ndimage, signal, special, stats
from scipy.optimize import elementwise
x = np.sin(np.arange(60.0) ** 1.5)
print(signal.sosfiltfilt(signal.butter(4, 0.2, output="sos"), x)[::9].tolist())
print(signal.savgol_filter(x, 9, 3, deriv=1)[::9].tolist(), signal.welch(x)[1][::9].tolist())
print(signal.find_peaks(x, prominence=0.3)[0].tolist(), ndimage.median_filter(x, 5)[::9].tolist())
print(float(stats.f.logsf(3.0, 2, 40)), float(stats.chi2.sf(3.0, 2)), float(stats.norm.ppf(0.1)))
figure = matplotlib.figure.Figure()
print(figure.set(facecolor="red", figheight=3.0), figure.get_facecolor(), figure.get_figheight())
print(float(stats.skew(x)), float(special.logsumexp(x)), linalg.expm(np.diag(x[:2])).tolist())
print(interpolate.CubicSpline(np.arange(60.0), x)(7.5).tolist(), fft.rfft(x)[3])
print(elementwise.find_root(lambda t: t * t - 2, (0.0, 2.0)).x)
"""
LEAVE = "from bayeshaptic.jobs.own_process import lighten_imports\nlighten_imports()\n"
ASK = """
print("nperseg" in signal.welch.__doc__, "facecolor" in str(matplotlib.figure.Figure.set.__doc__))
"""


def printed(code: str) -> str:
    """What a fresh interpreter prints."""
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True, timeout=60
    )
    return done.stdout


def test_functions_are_the_same_and_their_docstrings_gone() -> None:
    assert printed(LEAVE + COMPUTE) == printed(COMPUTE)
    assert printed(COMPUTE + ASK).split()[-2:] == ["True", "True"]
    assert printed(LEAVE + COMPUTE + ASK).split()[-2:] == ["False", "False"]


def test_what_filters_bring_along_is_imported_when_it_is_called() -> None:
    look = """
import sys
from scipy import signal
import numpy as np
brought = "scipy.stats", "scipy.interpolate", "scipy.spatial", "numpy.f2py", "numpy.testing"
print([name in sys.modules for name in brought])
x = np.sin(np.arange(200.0) ** 1.2)
print(signal.find_peaks_cwt(x, [2, 3]).tolist(), "scipy.stats" in sys.modules)
from scipy import spatial, stats
print(stats.__file__, stats.norm.cdf(0.3), spatial.cKDTree([[0.0], [1.0]]).query([0.9]))
print(np.f2py.__file__, np.testing.assert_allclose(1.0, 1.0))
"""
    usual, light = printed(look).splitlines(), printed(LEAVE + look).splitlines()
    assert "True" in usual[0]
    assert light[0] == str([False] * 5)
    assert light[1:] == usual[1:]


@pytest.mark.parametrize(
    "gone", ["scipy._lib._docscrape", "matplotlib.artist", "scipy.signal._peak_finding"]
)
def test_a_version_without_these_names_is_left_as_it_is(gone: str) -> None:
    hidden = f"import sys\nsys.modules[{gone!r}] = None\n"
    assert printed(hidden + LEAVE + f"del sys.modules[{gone!r}]\n" + COMPUTE) == printed(COMPUTE)


def test_nothing_is_collected_at_the_end() -> None:
    ended = printed(
        "import atexit, gc\n"
        "atexit.register(lambda: print(gc.get_freeze_count() > 0))\n"
        "from bayeshaptic.jobs.own_process import collect_garbage_rarely\n"
        "collect_garbage_rarely()\n"
    )
    assert ended.split() == ["True"]


def test_settings_for_other_figures_stop_no_report(tmp_path: Path) -> None:
    """Qt4Agg is a backend of an older matplotlib, which a profile may still name."""
    settings = tmp_path / "matplotlibrc"
    settings.write_text("no.such: thing\nfont.size: 40\n", encoding="utf-8")
    others = os.environ | {"MPLBACKEND": "Qt4Agg", "MATPLOTLIBRC": str(settings)}
    pictures = []
    for environment in (dict(os.environ), others):
        path = tmp_path / f"{len(pictures)}.png"
        line = [sys.executable, "-m", "bayeshaptic", "inspect", RECORDING, "--png", path]
        done = subprocess.run(line, env=environment, capture_output=True, timeout=120)
        assert (done.returncode, done.stderr) == (0, b"")
        pictures.append(path.read_bytes())
    assert pictures[0] == pictures[1]
