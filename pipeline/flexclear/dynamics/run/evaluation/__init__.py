"""From a model to an evaluation: the engine, the selection of closure rows, a consistent start, observed outputs."""
