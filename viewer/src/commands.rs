//! What the person at the window asks of the pipeline.

use crossbeam::channel::{Receiver, Sender, bounded};

/// A wish from the window; the pipeline decides what becomes of it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum UiCommand {
    Pause,
    Resume,
    /// One frame onwards, while paused.
    Step,
    /// Go to this frame of the recording (counted from 0).
    Seek {
        frame: u64,
    },
    Loop(Looping),
    /// Fine-tune now, with the keyframes there are.
    FineTune,
    CancelFineTuning,
    /// Forget keyframes and avatar: somebody else stands there now.
    StartOver,
    ExportGlb,
    Quit,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Looping {
    #[default]
    Once,
    Forever,
}

/// The window's end of the command channel.
#[derive(Clone, Debug)]
pub struct CommandSender(Sender<UiCommand>);

/// A bounded channel from the window to the pipeline.
pub fn command_channel(capacity: usize) -> (CommandSender, Receiver<UiCommand>) {
    let (sender, receiver) = bounded(capacity);
    (CommandSender(sender), receiver)
}

impl CommandSender {
    /// Hands a command over without ever waiting; `false` if nobody took it.
    pub fn send(&self, command: UiCommand) -> bool {
        self.0.try_send(command).is_ok()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_full_channel_refuses_commands_instead_of_blocking_the_window() {
        let (sender, receiver) = command_channel(2);
        assert!(sender.send(UiCommand::Pause));
        assert!(sender.send(UiCommand::Step));
        assert!(!sender.send(UiCommand::Resume));
        assert_eq!(
            receiver.try_iter().collect::<Vec<_>>(),
            [UiCommand::Pause, UiCommand::Step]
        );
    }

    #[test]
    fn a_pipeline_that_is_gone_refuses_commands() {
        let (sender, receiver) = command_channel(2);
        drop(receiver);
        assert!(!sender.send(UiCommand::Quit));
    }
}
