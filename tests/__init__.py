"""What proves the project. A package, so that scripts can render the scenes of `tests.parity`."""
