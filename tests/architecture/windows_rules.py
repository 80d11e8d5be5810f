"""What Windows lacks and forbids, imposed on Python here: loaded as `sitecustomize` by every process of a test.

Modules and functions of POSIX are gone. Below the folder of results names of devices, forbidden characters, and two
names that differ only in capitals are refused; so is taking away a file that is read-only, or that this process has
open.
"""

import os
import stat
import sys

import platformdirs.unix  # noqa: F401 - both ask for functions that are gone below, and would not be here on Windows
import psutil  # noqa: F401

#: what Windows does not have, of modules and of `os`
MODULES = ("fcntl", "resource", "grp", "pwd", "termios")
FUNCTIONS = ("sched_getaffinity", "geteuid", "getuid", "setsid", "fork", "killpg", "sysconf", "getpgid")
DEVICES = {"con", "prn", "aux", "nul", *(f"{port}{k}" for port in ("com", "lpt") for k in range(10))}


def _names(path: str) -> None:
    for name in path.removeprefix(RESULTS).strip("/").split("/"):
        if name.lower().partition(".")[0] in DEVICES or name.endswith((".", " ")) or set(name) & set('<>:"|?*\\'):
            raise OSError(22, "no such name on Windows", path)


def _new(path: str) -> None:
    folder, name = os.path.split(path)
    if os.path.isdir(folder) and any(n != name and n.lower() == name.lower() for n in os.listdir(folder)):
        raise PermissionError(13, "a name that Windows takes for another one", path)


def _taken(path: str) -> None:
    if not os.path.lexists(path):
        return
    if not os.lstat(path).st_mode & stat.S_IWRITE:
        raise PermissionError(13, "read-only files stay, on Windows", path)
    _moved(path)


def _moved(path: str) -> None:
    for handle in os.listdir("/proc/self/fd"):
        try:
            if os.readlink(f"/proc/self/fd/{handle}") == path:
                raise PermissionError(13, "open files stay, on Windows", path)
        except FileNotFoundError:
            continue


def _rules(event: str, arguments: tuple[object, ...]) -> None:
    paths = [os.fspath(path) for path in arguments[:2] if isinstance(path, (str, os.PathLike))]
    if (
        event not in ("open", "os.rename", "os.remove", "os.mkdir")
        or not paths
        or not paths[0].startswith(RESULTS + "/")
    ):
        return
    _names(paths[-1] if event == "os.rename" else paths[0])
    if event == "os.rename":
        _moved(paths[0])
        _taken(paths[1])
        _new(paths[1])
    elif event == "os.remove":
        _taken(paths[0])
    elif event == "os.mkdir" or (isinstance(arguments[2], int) and arguments[2] & os.O_CREAT):
        _new(paths[0])


#: the folder where the rules hold
RESULTS = os.environ.get("FLEXCLEAR_RESULTS", "")
if __name__ == "sitecustomize":
    for module in MODULES:
        sys.modules[module] = None  # type: ignore[assignment]
    for function in FUNCTIONS:
        delattr(os, function)
    sys.addaudithook(_rules)
