"""The command: ``python -m biscale.batch run SPEC -o DIR``, ``python -m biscale.batch status DIR``."""

from __future__ import annotations

import argparse
import dataclasses
import errno
import json
import sys
from typing import Any

from .. import InputError
from . import run, status


def _shard(text: str) -> tuple[int, int]:
    k, _, n = text.partition("/")
    return int(k), int(n)


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="python -m biscale.batch", description=__doc__)
    commands = parser.add_subparsers(dest="command", required=True)
    make = commands.add_parser("run", help="make the materials of a specification")
    make.add_argument("spec", help="a .toml, .parquet or .csv file")
    make.add_argument("-o", "--output", required=True, metavar="DIR")
    make.add_argument("--shard", type=_shard, metavar="K/N", help="the K-th of N parts, in this process alone")
    make.add_argument("--scheduler", metavar="ADDRESS", help="a Dask scheduler; without it, this machine")
    make.add_argument("--retry-failed", action="store_true", help="make parts with failed rows again")
    make.add_argument("--limit", type=int, metavar="N", help="the first N rows only")
    make.add_argument("--into-new-spec", action="store_true", help="replace what another specification or build made")
    make.add_argument("--force", action="store_true", help="begin even if the disk is too small")
    make.add_argument("--json", action="store_true", help="print a machine-readable report")
    show = commands.add_parser("status", help="count what is made and what failed")
    show.add_argument("directory")
    show.add_argument("--json", action="store_true", help="print a machine-readable report")
    return parser


def _run(arguments: argparse.Namespace) -> int:
    client: Any = None
    if arguments.scheduler:
        from distributed import Client

        client = Client(arguments.scheduler)
    result = run(
        arguments.spec,
        arguments.output,
        client,
        arguments.shard,
        arguments.retry_failed,
        limit=arguments.limit,
        into_new_spec=arguments.into_new_spec,
        force=arguments.force,
    )
    if arguments.json:
        print(json.dumps(dataclasses.asdict(result), indent=1))
    else:
        print(f"{result.made} made, {result.failed} failed, {result.kept} kept in {result.seconds:.1f} s")
        for complaint, count in result.complaints.items():
            print(f"  {count} x {complaint}")
    return 1 if result.failed else 0


def main(argv: list[str] | None = None) -> int:
    """Runs the command. 0: all made; 1: some failed, or a file cannot be written; 2: bad input."""
    arguments = _parser().parse_args(argv)
    try:
        if arguments.command == "run":
            return _run(arguments)
        state = status(arguments.directory)
        if arguments.json:
            print(json.dumps(state, indent=1))
        else:
            for name, value in state.items():
                print(f"{name}: {value}")
        return 0
    except InputError as error:
        print(f"biscale.batch: {error}", file=sys.stderr)
        return 2
    except OSError as error:
        print(f"biscale.batch: {error.filename or arguments.output}: {_advice(error)}", file=sys.stderr)
        return 1


def _advice(error: OSError) -> str:
    """What failed, and what to do about it."""
    if error.errno in (errno.EACCES, errno.EPERM, errno.EROFS):
        return f"{error.strerror}: the folder cannot be written; choose another one or change its permissions"
    return f"{error.strerror}; free some space or choose another folder"


if __name__ == "__main__":
    sys.exit(main())
