"""The commands of the command line, one module each.

A command is a module with NAME, SUMMARY (one line), DESCRIPTION, EXAMPLES, a function
``add_arguments(parser)`` and a function ``run(arguments) -> exit status``. To add one, write the
module and name it in COMMANDS. Modules import what they run inside `run`, so that help is instant.
"""

from __future__ import annotations

from bayeshaptic.commands import (
    batch,
    explain,
    inspect,
    population,
    relay,
    report,
    simulate,
    status,
)

COMMANDS = (report, inspect, relay, simulate, population, batch, status, explain)
