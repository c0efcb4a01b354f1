"""The public names, and where each of them lives: read by type checkers, and on first use."""

from . import plot as plot
from .devices import Device as Device, device_names as device_names, load_device as load_device
from .diagnosis.analyse import analyse as analyse
from .diagnosis.analysis import Analysis as Analysis
from .diagnosis.close_loop import close_loop as close_loop
from .diagnosis.closed import Closed as Closed
from .diagnosis.options import Options as Options
from .errors import (
    BayeshapticWarning as BayeshapticWarning,
    InputError as InputError,
    Notice as Notice,
)
from .inference.choose import Choice as Choice, choose_model as choose_model
from .inference.fit import Fit as Fit
from .inference.least_squares import least_squares as least_squares
from .inference.load import load_posterior as load_posterior
from .inference.next_experiment import Experiment as Experiment, next_experiment as next_experiment
from .inference.population.infer import infer_population as infer_population
from .inference.population.population import Population as Population
from .inference.posterior import Posterior as Posterior
from .inference.sampler import sample as sample
from .jobs.batch import run_batch as run_batch
from .jobs.job import Settings as Settings
from .models import (
    HalfNormal as HalfNormal,
    LogNormal as LogNormal,
    LogUniform as LogUniform,
    MaybeZero as MaybeZero,
    Model as Model,
    NearZero as NearZero,
    Normal as Normal,
    Uniform as Uniform,
    chain as chain,
    free as free,
    grasped as grasped,
    rigid as rigid,
)
from .recordings import (
    Recording as Recording,
    Study as Study,
    join_recordings as join_recordings,
    read_frf as read_frf,
    read_measurement as read_measurement,
    read_recording as read_recording,
    read_study as read_study,
    recording_from_arrays as recording_from_arrays,
)
from .recordings.response.estimate import estimate_etfe as estimate_etfe
from .recordings.response.etfe import Etfe as Etfe
from .report import write_report as write_report
from .report.study.write import write_study_report as write_study_report
from .stability import (
    Backward as Backward,
    Case as Case,
    CriticalStiffness as CriticalStiffness,
    KbRegion as KbRegion,
    LowPass as LowPass,
    RelayMeasurement as RelayMeasurement,
    critical_stiffness as critical_stiffness,
    device_limit as device_limit,
    measure_relay as measure_relay,
)
from .stability.guidance.elasticities import (
    Elasticities as Elasticities,
    elasticities as elasticities,
)
from .stability.guidance.shares import (
    VarianceShares as VarianceShares,
    variance_shares as variance_shares,
)
from .stability.guidance.sweep import Sweep as Sweep, sweep as sweep
from .stability.walls.limit_table import LimitTable as LimitTable, limit_table as limit_table
from .stability.walls.region import kb_region as kb_region
from .study.analysis import StudyAnalysis as StudyAnalysis, analyse_study as analyse_study
from .version import __version__ as __version__
