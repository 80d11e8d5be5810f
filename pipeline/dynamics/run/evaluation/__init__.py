"""From a model to an evaluation: the engine, the choice of closure rows, a consistent start, what is observed."""
