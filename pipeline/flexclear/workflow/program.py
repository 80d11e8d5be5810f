"""What every program on this package does around its work: exit codes, signals, errors without a traceback."""

from __future__ import annotations

import atexit
import gc
import os
import signal
import sys
from collections.abc import Callable
from types import FrameType

from flexclear.system.errors import INTERRUPTED, FlexclearError, ResourceError, terminal_text
from flexclear.system.platforms import plain_output, reader_has_gone
from flexclear.workflow import workers


def exit_code(work: Callable[[], object], *, own: bool = True) -> int:
    """Do the work and return the exit code, as the command ``flexclear`` has them; errors are printed.

    work: returns an exit code, or None for 0.  own: whether this process is the program's own, to end afterwards.
    """
    plain_output()
    if own:
        signal.signal(signal.SIGTERM, _as_interrupt)
        # 200_000: new objects before Python's garbage collector runs: a short command makes hardly any garbage, and
        # spent a tenth of its time on collections
        gc.set_threshold(200_000, *gc.get_threshold()[1:])
        # at exit Python collects garbage several times over all objects: a sixth of the time of a short command, half a
        # second where something was compiled. Nobody gains by that, since the system takes all memory back
        atexit.register(gc.freeze)
    # pydantic would search all installed packages for plugins of its own
    os.environ.setdefault("PYDANTIC_DISABLE_PLUGINS", "__all__")
    try:
        with workers.keep_workers():
            code = work()
            return code if isinstance(code, int) else 0
    except FlexclearError as error:
        print(f"flexclear: {error}", file=sys.stderr)
        return error.exit_code
    except KeyboardInterrupt:
        print("\nflexclear: interrupted; finished results are stored", file=sys.stderr)
        return INTERRUPTED
    except BrokenPipeError:
        if not reader_has_gone():
            print(f"flexclear: {workers.LOST}", file=sys.stderr)
            return ResourceError.exit_code
        # the reader (`| head`) has closed the pipe; keep the interpreter from reporting that at exit
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 141  # of a closed pipe, as shells count: 128 + SIGPIPE
    except (OSError, MemoryError) as error:  # errors of the machine that no other code described better
        print(f"flexclear: {terminal_text(str(error)) or 'there is not enough memory'}", file=sys.stderr)
        return ResourceError.exit_code


def _as_interrupt(number: int, frame: FrameType | None) -> None:
    """Stop as Ctrl-C does: schedulers of clusters and services send SIGTERM, and workers must end in good order."""
    handler = signal.getsignal(signal.SIGINT)
    if not callable(handler):  # Ctrl-C is ignored by a command in the background
        raise KeyboardInterrupt
    handler(number, frame)
