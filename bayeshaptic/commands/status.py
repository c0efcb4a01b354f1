"""``bayeshaptic status``: how far a batch is."""

from __future__ import annotations

import argparse
from collections import Counter
from pathlib import Path

from bayeshaptic.errors import InputError, one_line

NAME = "status"
SUMMARY = "how far a batch is, from another shell"
DESCRIPTION = """\
Say how many reports of a batch are done, failed and left, from the manifest in its folder. The exit
status is 0 where all are done, 1 otherwise."""
EXAMPLES = """\
  bayeshaptic status reports/"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The folder."""
    parser.add_argument("folder", type=Path, metavar="DIR", help="the -o of the batch")


def run(arguments: argparse.Namespace) -> int:
    """Print it."""
    from bayeshaptic.jobs.manifest import has_ended, read_manifest

    entries = read_manifest(arguments.folder).values()
    if not entries:
        raise InputError(f"{arguments.folder}: no manifest.json of a batch in this folder")
    count = Counter(entry.state for entry in entries)
    print(
        f"{arguments.folder}: {count['done']} of {len(entries)} done, {count['failed']} failed, "
        f"{count['waiting']} left"
    )
    if count["waiting"] and has_ended(arguments.folder):
        print("  its process has ended; the command of the batch, given again, goes on from here")
    for entry in entries:
        if entry.error:
            print(f"  {one_line(entry.error)}")
    return 0 if count["done"] == len(entries) else 1
