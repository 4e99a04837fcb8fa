"""The process that proves a renaming, started by the server for each, since a deck is compiled in its own folder.

python -m ic.editor.renamer        a pickled `RenameRequest` on standard input, `Renamed` on standard output
"""

from __future__ import annotations

import pickle
import sys

from ic.editor.renaming import renamed


def main() -> None:
    """Answer one request."""
    answer = renamed(pickle.load(sys.stdin.buffer))
    sys.stdout.buffer.write(pickle.dumps(answer))


if __name__ == "__main__":
    main()
