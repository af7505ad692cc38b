"""What goes wrong, with the words of the command line."""


class HandeyeError(Exception):
    """Base of what this module raises on purpose."""


class InputError(HandeyeError, ValueError):
    """What was given cannot be used as it is: a shape, a number that is none, a file. The message says which and what to do.
    The command line ends with exit code 2 where this is raised."""


class CalibrationError(HandeyeError, RuntimeError):
    """The data can be used and have no answer: too few views, no rotation, turns about one axis only. The message says what
    to capture. The command line ends with exit code 1 where this is raised."""


class CalibrationWarning(UserWarning):
    """A function whose return value has no place for it leaves something out, or doubts its input."""
