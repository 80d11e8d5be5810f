"""The dataset of one run (schema RUN), up to a time or whole; with events it consists of phases, which are one part."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from flexclear.artifacts.labelled import Labelled, LabelledArrays
from flexclear.artifacts.schema import mark_incomplete
from flexclear.dynamics.record.dataset import record_run, warnings
from flexclear.dynamics.run.evaluation.engine import Engine
from flexclear.dynamics.run.progress_rate import Judges
from flexclear.dynamics.run.run import Run, RunInParts
from flexclear.scene.schema import Scene
from flexclear.system.progress import Progress
from flexclear.workflow import stopping


class SingleRun:
    """A run that is recorded in parts, as `RunInParts`, with the same errors; StoppedError holds the rows so far."""

    def __init__(
        self,
        scene: Scene,
        bundles: Mapping[str, Labelled],
        progress: Progress,
        judges: Judges | None = None,
        known: Engine | None = None,
    ) -> None:
        """Build and start a scene; arguments as of `RunInParts`."""
        self._progress, self._scene = progress, scene
        self._run: RunInParts | LabelledArrays
        if scene.event:
            from flexclear.dynamics.events import phases  # here, since it imports SciPy

            self._run = phases.run_with_events(scene, bundles, progress, judges)
        else:
            self._run = RunInParts(scene, bundles, progress, judges, known)

    @property
    def engine(self) -> Engine | None:
        """Engine of the run; None for one with events."""
        return self._run.engine if isinstance(self._run, RunInParts) else None

    def until(self, time: float) -> LabelledArrays:
        """Return the run up to a time [s] or later, without predictability horizon and stresses that none requests."""
        if not isinstance(self._run, RunInParts):
            return self._run
        return self._recorded(replace(self._run.until(time), scene=self._scene.with_requested_output()))

    def whole(self) -> LabelledArrays:
        """Return the run to its end, with its horizon, and report its warnings."""
        if not isinstance(self._run, RunInParts):
            return self._run
        done = self._run.whole()
        result = self._recorded(done)
        for sentence in warnings(done):
            self._progress(None, f"warning: {sentence}")
        return result

    def _recorded(self, done: Run) -> LabelledArrays:
        if done.stopped:
            raise stopping.stopping_error(done.stopped, mark_incomplete(record_run(done), done.stopped))
        return record_run(done)
