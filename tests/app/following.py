"""Jobs run to their end."""

from nerfnav_app.jobs.events import JobEvent, JobEvents, JobResult, JobRun


def followed(job: JobEvents) -> tuple[list[JobEvent], JobResult]:
    """All that a job yields, and what it returns."""
    running = JobRun(job)
    return list(running), running.result


def result_of(job: JobEvents) -> JobResult:
    """What a job returns."""
    return followed(job)[1]
