"""The commands. Each parses its options and calls `bsg_data` or `bsg_models`."""

import signal
import sys
from pathlib import PurePath

# While a command imports, Ctrl-C ends it without a traceback; `Command.main` takes over then.
if (
    PurePath(sys.argv[0]).name.startswith("bsg-")
    and signal.getsignal(signal.SIGINT) is signal.default_int_handler
):
    signal.signal(signal.SIGINT, signal.SIG_DFL)
