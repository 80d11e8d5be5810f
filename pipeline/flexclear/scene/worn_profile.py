"""Profiles of worn surfaces as ``flexclear wear`` writes them."""

from pathlib import Path
from typing import Any


def read_profile(path: Path) -> dict[str, dict[str, Any]]:
    """Return the worn surfaces in the last row of a profile's file, by joint, with the keys of `Shapes`.

    Raises ValueError, in words, for a file that cannot be read or that is no profile.
    """
    import netCDF4  # here, since most scenes have no profile
    import numpy as np

    if not path.is_file():
        raise ValueError(f"there is no file {path}" if not path.exists() else f"'{path}' is not an ordinary file")
    names = ("worn", "wear_sectors", "wear_bands", "radius_outer", "radius_inner", "depth_outer", "depth_inner")
    try:
        with netCDF4.Dataset(path) as file:
            file.set_auto_mask(False)
            missing = [name for name in names if name not in file.variables]
            if missing:
                raise ValueError(
                    f"{path.name} is no profile of worn surfaces: it has no variable '{missing[0]}'; name the wear.nc "
                    "of `flexclear wear`"
                )
            found = {name: np.asarray(file[name][:]) for name in names}
            worn, sectors, bands = (found[name].tolist() for name in names[:3])
            last = {side: found[f"depth_{side}"][-1] for side in ("outer", "inner")}
            shapes = {
                str(name): {
                    "radii": tuple(float(found[f"radius_{side}"][k]) for side in last),
                    **{side: depths[k, : bands[k], : sectors[k]].tolist() for side, depths in last.items()},
                }
                for k, name in enumerate(worn)
            }
    except (OSError, RuntimeError, IndexError, KeyError, TypeError) as error:
        raise ValueError(f"{path.name} cannot be read as a profile: {str(error) or type(error).__name__}") from None
    if not all(np.isfinite(depths).all() for depths in last.values()):
        raise ValueError(f"{path.name} is damaged: its depths are no finite numbers; compute it again")
    return shapes
