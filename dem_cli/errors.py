"""The exceptions of the program. The command line turns each into one line and an exit code."""


class DemError(Exception):
    """Root of all errors that dem-cli raises on purpose; `exit_code` is what `dem` ends with."""

    exit_code = 1


class ScenarioError(DemError):
    """The user's scenario, option or file is wrong; the message holds one line per mistake."""

    exit_code = 2


class OverrideError(ScenarioError):
    """A change to a scenario, from the command line or a sweep, that names no key of it, or no single one."""


class ResultsError(DemError):
    """A result file is missing, of another kind or version, or would be overwritten."""

    exit_code = 2


class RunError(DemError):
    """A run could not go on (blow-up, unstable step): the message names grain, time, cause and remedy."""
