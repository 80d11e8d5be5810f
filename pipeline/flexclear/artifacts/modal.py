"""``dataset.modal``: truncation of a bundle's modes in all variables at once; registered by importing this module."""

from __future__ import annotations

import xarray as xr

from flexclear.artifacts.compliance import fractions, of_bundle
from flexclear.system.errors import InputError

#: dimensions that count modes
DIMENSIONS = ("mode", "mode2")
#: variables computed for all modes together, which cannot be derived for fewer
OF_ALL = ("error_bound", "bound_frequency", "stress_field", "field")


@xr.register_dataset_accessor("modal")
class Modal:
    """Modes of a dataset (bundle, modes, or run). Holds no state besides the dataset."""

    def __init__(self, dataset: xr.Dataset) -> None:
        self._dataset = dataset

    @property
    def count(self) -> int:
        """Number of modes."""
        return int(self._dataset.sizes.get("mode", 0))

    def truncate(self, count: int) -> xr.Dataset:
        """Return the dataset with its first `count` modes only, in every variable that counts modes.

        The modes of a bundle are eigenvectors of its reduced matrices, so that the first of them are a basis of their
        own. Fractions of compliance are computed again; the error bound and the resolved frequency are dropped. Raises
        InputError for a count out of range, or that cuts a pair of equal frequencies.
        """
        self._check(count)
        result = self._dataset.isel({name: slice(count) for name in DIMENSIONS if name in self._dataset.dims})
        result = result.drop_vars(OF_ALL, errors="ignore")
        result.attrs = {name: value for name, value in result.attrs.items() if name != "resolved_frequency"}
        if "count" in result.attrs:
            result.attrs["count"] = count
        if "compliance_full" in result and "modal_stiffness" in result:
            kept_part = fractions(of_bundle(result), result["compliance_full"].values)
            result["compliance_share"] = result["compliance_share"].copy(data=kept_part)
        return result

    def _check(self, count: int) -> None:
        if not 1 <= count <= self.count:
            raise InputError("modal.truncate", f"{count} of {self.count} modes", f"request 1 to {self.count}")
        if "frequency" in self._dataset and count < self.count:
            last, following = self._dataset["frequency"].values[count - 1 : count + 1]
            if following - last <= 1e-6 * following:
                raise InputError(
                    "modal.truncate", f"{count} modes split a pair of equal frequencies at {last:.6g} Hz", "keep both"
                )
