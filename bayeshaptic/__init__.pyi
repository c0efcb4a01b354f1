"""The public names, and where each of them lives: read by type checkers, and on first use."""

from . import plot as plot
from .devices import (
    Device as Device,
)
from .devices import (
    device_names as device_names,
)
from .devices import (
    load_device as load_device,
)
from .diagnosis.analyse import analyse as analyse
from .diagnosis.analysis import (
    Analysis as Analysis,
)
from .diagnosis.close_loop import close_loop as close_loop
from .diagnosis.closed import (
    Closed as Closed,
)
from .diagnosis.options import (
    Options as Options,
)
from .errors import (
    BayeshapticWarning as BayeshapticWarning,
)
from .errors import (
    InputError as InputError,
)
from .errors import (
    Notice as Notice,
)
from .inference.choose import (
    Choice as Choice,
)
from .inference.choose import (
    choose_model as choose_model,
)
from .inference.fit import (
    Fit as Fit,
)
from .inference.least_squares import (
    least_squares as least_squares,
)
from .inference.load import (
    load_posterior as load_posterior,
)
from .inference.next_experiment import (
    Experiment as Experiment,
)
from .inference.next_experiment import (
    next_experiment as next_experiment,
)
from .inference.population.infer import (
    infer_population as infer_population,
)
from .inference.population.population import (
    Population as Population,
)
from .inference.posterior import (
    Posterior as Posterior,
)
from .inference.sampler import (
    sample as sample,
)
from .jobs.batch import (
    run_batch as run_batch,
)
from .jobs.job import (
    Settings as Settings,
)
from .models import (
    HalfNormal as HalfNormal,
)
from .models import (
    LogNormal as LogNormal,
)
from .models import (
    LogUniform as LogUniform,
)
from .models import (
    MaybeZero as MaybeZero,
)
from .models import (
    Model as Model,
)
from .models import (
    NearZero as NearZero,
)
from .models import (
    Normal as Normal,
)
from .models import (
    Uniform as Uniform,
)
from .models import (
    chain as chain,
)
from .models import (
    free as free,
)
from .models import (
    grasped as grasped,
)
from .models import (
    rigid as rigid,
)
from .recordings import (
    Recording as Recording,
)
from .recordings import (
    Study as Study,
)
from .recordings import (
    join_recordings as join_recordings,
)
from .recordings import (
    read_frf as read_frf,
)
from .recordings import (
    read_measurement as read_measurement,
)
from .recordings import (
    read_recording as read_recording,
)
from .recordings import (
    read_study as read_study,
)
from .recordings import (
    recording_from_arrays as recording_from_arrays,
)
from .recordings.response.estimate import (
    estimate_etfe as estimate_etfe,
)
from .recordings.response.etfe import (
    Etfe as Etfe,
)
from .report import (
    write_report as write_report,
)
from .report.study.write import (
    write_study_report as write_study_report,
)
from .stability import (
    Backward as Backward,
)
from .stability import (
    Case as Case,
)
from .stability import (
    CriticalStiffness as CriticalStiffness,
)
from .stability import (
    KbRegion as KbRegion,
)
from .stability import (
    LowPass as LowPass,
)
from .stability import (
    RelayMeasurement as RelayMeasurement,
)
from .stability import (
    critical_stiffness as critical_stiffness,
)
from .stability import (
    device_limit as device_limit,
)
from .stability import (
    measure_relay as measure_relay,
)
from .stability.guidance.elasticities import (
    Elasticities as Elasticities,
)
from .stability.guidance.elasticities import (
    elasticities as elasticities,
)
from .stability.guidance.shares import (
    VarianceShares as VarianceShares,
)
from .stability.guidance.shares import (
    variance_shares as variance_shares,
)
from .stability.guidance.sweep import (
    Sweep as Sweep,
)
from .stability.guidance.sweep import (
    sweep as sweep,
)
from .stability.walls.limit_table import (
    LimitTable as LimitTable,
)
from .stability.walls.limit_table import (
    limit_table as limit_table,
)
from .stability.walls.region import (
    kb_region as kb_region,
)
from .study.analysis import (
    StudyAnalysis as StudyAnalysis,
)
from .study.analysis import (
    analyse_study as analyse_study,
)
from .version import (
    __version__ as __version__,
)
