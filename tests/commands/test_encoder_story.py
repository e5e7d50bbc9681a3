"""The steps of an encoder adjustment: one after the other, each with its times and values, and what a state of the drive means."""

import pytest

from app.commands.encoder_story import ADJUSTED, SAVE, STEPS, WAIT_LIMIT, StepState, Story, verdict


def test_steps_go_from_waiting_over_active_to_done_and_keep_their_times() -> None:
    story = Story(12_000, "Eva")
    assert not story.over and {one.state for one in story.steps} == {StepState.WAITING}
    for at, key in enumerate(STEPS, 1):
        story = story.began(key, 10 * at)
        assert story.step(key).state is StepState.ACTIVE and not story.over
        story = story.saw(key, at).done(key, 10 * at + 5)
        assert (story.step(key).began, story.step(key).ended, story.step(key).value) == (10 * at, 10 * at + 5, at)
    assert story.over and story.succeeded and story.failed is None
    assert story.save.state is StepState.WAITING  # a step of its own


@pytest.mark.parametrize("key", STEPS)
def test_a_step_that_fails_ends_the_story_and_says_why(key: str) -> None:
    story = Story(0, "Eva").began(key, 1).broke(key, 2, "why.enc_error", {"seconds": 1})
    assert story.over and not story.succeeded and story.failed == story.step(key)
    assert (story.step(key).reason, story.step(key).params) == ("why.enc_error", {"seconds": 1})
    assert story.began(key, 3).step(key).reason == ""


def test_saving_that_fails_leaves_the_adjustment_a_success() -> None:
    story = Story(0, "Eva")
    for key in STEPS:
        story = story.done(key, 1)
    story = story.began(SAVE, 2).broke(SAVE, 3, "why.par_not_saved", {})
    assert story.succeeded and story.save.state is StepState.FAILED
    assert story.began(SAVE, 4).done(SAVE, 5).save.state is StepState.DONE


@pytest.mark.parametrize(
    ("state", "early", "late"),
    [(0, "why.enc_error", "why.enc_error"), (1, "why.enc_not_adjusted", "why.enc_not_adjusted"), (2, None, "why.enc_timeout"),
     (ADJUSTED, "", ""), (None, None, "why.enc_unread"), (7, None, "why.enc_timeout")],
)  # fmt: skip
def test_every_state_of_the_drive_has_a_verdict_before_and_after_the_limit(
    state: float | None, early: str | None, late: str
) -> None:
    assert verdict(state, WAIT_LIMIT - 0.01) == early and verdict(state, WAIT_LIMIT) == late
