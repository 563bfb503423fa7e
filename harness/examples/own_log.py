"""A log of your own: how far is the twin from it, and which fault explains it?

python own_log.py LOG [--actuator NAME_OR_FILE] [--column PORT=COLUMN ...] [--fmus DIR]
"""

import argparse
import sys

import harness as ema


def main() -> int:
    options = argparse.ArgumentParser()
    options.add_argument("log", help="in any format; ema columns LOG shows what is in it")
    options.add_argument("--actuator", help="a name of the library, or a file")
    options.add_argument("--column", action="append", default=[], metavar="PORT=COLUMN")
    options.add_argument("--fmus", help="folder of the FMUs; the package's own if not given")
    given = options.parse_args()

    columns = dict(text.split("=", 1) for text in given.column)
    common = {"actuator": given.actuator, "columns": columns, "fmus": given.fmus}
    try:
        print(ema.replay(given.log, **common))
        found = ema.identify(given.log, **common)
    except ema.HarnessError as error:
        print(f"{given.log}: {error}", file=sys.stderr)
        return 2
    print(found)
    return 0 if found.explained else 1


if __name__ == "__main__":
    sys.exit(main())
