//! What a page needs next.

/// How far one side of the slider is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) enum Outcome {
    /// Not begun.
    #[default]
    Missing,
    /// A reference with some of its samples.
    Part,
    /// As good as was asked for.
    Finished,
    /// It cannot be made.
    Failed,
}

/// What a page has seen of its view.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct StagesDone {
    /// A quick picture: was it as large as the window?
    pub(super) quick: Option<bool>,
    /// The mode that was asked for.
    pub(super) first: Outcome,
    /// The other side of the slider.
    pub(super) second: Outcome,
    /// Both sides as they are now, held against each other.
    pub(super) compared: bool,
}

/// The picture that is made next.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Task {
    /// A quick picture, smaller than the window where it must be.
    Quick,
    /// A quick picture as large as the window.
    Whole,
    /// The mode that was asked for.
    First,
    /// The other side of the slider, or more samples of it.
    Second,
    /// The errors of the first side against the second.
    Compare,
}

/// The next task; `None`: nothing. `moving`: the view changes all the time. `split`: there is another side.
pub(super) fn next(moving: bool, split: bool, done: StagesDone) -> Option<Task> {
    let Some(whole) = done.quick else { return Some(Task::Quick) };
    let both = done.first == Outcome::Finished && matches!(done.second, Outcome::Part | Outcome::Finished);
    if moving {
        None
    } else if done.first == Outcome::Missing {
        Some(if whole { Task::First } else { Task::Whole })
    } else if split && done.second == Outcome::Missing {
        Some(Task::Second)
    } else if split && both && !done.compared {
        Some(Task::Compare)
    } else {
        (split && done.second == Outcome::Part).then_some(Task::Second)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// All tasks of a view, until there is none; a reference takes two rounds. `small`: the quick picture is.
    fn tasks(moving: bool, split: bool, small: bool) -> Vec<Task> {
        let (mut done, mut tasks) = (StagesDone::default(), Vec::new());
        while let Some(task) = next(moving, split, done) {
            tasks.push(task);
            match task {
                Task::Quick => done.quick = Some(!small),
                Task::Whole => done.quick = Some(true),
                Task::First => done.first = Outcome::Finished,
                Task::Second => {
                    done.compared = false;
                    done.second = if done.second == Outcome::Missing { Outcome::Part } else { Outcome::Finished };
                }
                Task::Compare => done.compared = true,
            }
        }
        tasks
    }

    #[test]
    fn what_moves_is_shown_quickly_and_no_more() {
        assert_eq!(tasks(true, false, true), [Task::Quick]);
        assert_eq!(tasks(true, true, false), [Task::Quick]);
    }

    #[test]
    fn what_rests_is_refined() {
        assert_eq!(tasks(false, false, false), [Task::Quick, Task::First]);
        assert_eq!(tasks(false, false, true), [Task::Quick, Task::Whole, Task::First]);
    }

    #[test]
    fn a_reference_is_compared_after_each_round() {
        use Task::{Compare, First, Quick, Second};
        assert_eq!(tasks(false, true, false), [Quick, First, Second, Compare, Second, Compare]);
    }

    #[test]
    fn what_failed_is_not_tried_again() {
        let done = StagesDone { quick: Some(true), first: Outcome::Failed, ..StagesDone::default() };
        assert_eq!(next(false, false, done), None);
        assert_eq!(next(false, true, done), Some(Task::Second));
        assert_eq!(next(false, true, StagesDone { second: Outcome::Finished, ..done }), None);
    }
}
