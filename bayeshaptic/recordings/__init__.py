"""What was measured: recordings, studies, their readers and checks."""

from bayeshaptic.recordings.checks.check import check_recording
from bayeshaptic.recordings.from_arrays import recording_from_arrays
from bayeshaptic.recordings.join import join_recordings
from bayeshaptic.recordings.measurement import read_measurement
from bayeshaptic.recordings.read import read_recording
from bayeshaptic.recordings.readers import Reader, register_reader
from bayeshaptic.recordings.recording import Recording
from bayeshaptic.recordings.response.frf_table import read_frf
from bayeshaptic.recordings.signals.raw_signals import Clipping, clipping, increment_unit
from bayeshaptic.recordings.study import Study, StudyEntry
from bayeshaptic.recordings.study_file import read_study

__all__ = [
    "Clipping",
    "Reader",
    "Recording",
    "Study",
    "StudyEntry",
    "check_recording",
    "clipping",
    "increment_unit",
    "join_recordings",
    "read_frf",
    "read_measurement",
    "read_recording",
    "read_study",
    "recording_from_arrays",
    "register_reader",
]
