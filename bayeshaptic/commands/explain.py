"""``bayeshaptic explain``: what a message means."""

from __future__ import annotations

import argparse
import textwrap

NAME = "explain"
SUMMARY = "what a warning or a refusal means, and what to do"
DESCRIPTION = """\
Print what a message means, and what to do. Every warning and every refusal ends with its word;
without one, all of them are listed."""
EXAMPLES = """\
  bayeshaptic explain feedback
  bayeshaptic explain"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The word."""
    parser.add_argument("word", nargs="*", metavar="WORD", help="of a message, as in time-stamps")


def run(arguments: argparse.Namespace) -> int:
    """Print the entry; 0."""
    from bayeshaptic.faq import entries, entry, without_links

    if not arguments.word:
        for one in entries().values():
            print(f"{one.word:18} {one.title}")
        return 0
    found = entry(" ".join(arguments.word))
    print(found.title)
    for paragraph in found.paragraphs:
        print()
        print(textwrap.fill(without_links(paragraph), 80, break_on_hyphens=False))
    return 0
