//! How values pass between threads that must not wait for each other.
//!
//! [`Latest`] where only the newest counts; [`DropOldest`] where each counts, but not at the price of falling behind.
//! A queue that loses nothing and lets the source wait is crossbeam's `bounded`.

use std::{
    collections::VecDeque,
    sync::{Condvar, Mutex, MutexGuard, PoisonError},
    time::Duration,
};

/// A slot in which a newer value replaces the one that nobody took. Share it in an `Arc`.
pub struct Latest<T> {
    queue: DropOldest<T>,
}

impl<T> Default for Latest<T> {
    fn default() -> Self {
        Self { queue: DropOldest::new(1) }
    }
}

impl<T> Latest<T> {
    /// Puts a value in and wakes a waiting reader. Returns the value that it replaces.
    pub fn put(&self, value: T) -> Option<T> {
        self.queue.push(value)
    }

    /// Takes the value, if there is one.
    pub fn try_take(&self) -> Option<T> {
        self.queue.try_pop()
    }

    /// Waits for a value.
    pub fn take(&self) -> Option<T> {
        self.queue.pop()
    }

    /// Waits no longer than this for a value.
    pub fn take_within(&self, patience: Duration) -> Taken<T> {
        self.queue.pop_within(patience)
    }

    /// No value follows: readers get what is left and then `None`.
    pub fn close(&self) {
        self.queue.close();
    }

    /// How many values were replaced before anybody took them.
    pub fn dropped(&self) -> u64 {
        self.queue.dropped()
    }
}

/// What waiting for a while brought.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Taken<T> {
    Value(T),
    /// Nothing came in time.
    Nothing,
    /// Nothing will come any more.
    Closed,
}

/// A queue that holds so many values; a further one pushes the oldest out, and that is counted. Share it in an `Arc`.
pub struct DropOldest<T> {
    capacity: usize,
    state: Mutex<State<T>>,
    changed: Condvar,
}

struct State<T> {
    values: VecDeque<T>,
    dropped: u64,
    closed: bool,
}

impl<T> DropOldest<T> {
    /// A queue for at least one value.
    pub fn new(capacity: usize) -> Self {
        let capacity = capacity.max(1);
        let state = State { values: VecDeque::with_capacity(capacity), dropped: 0, closed: false };
        Self { capacity, state: Mutex::new(state), changed: Condvar::new() }
    }

    /// Adds a value without ever waiting. Returns the one that had to go: the oldest, or this one if the queue is closed.
    pub fn push(&self, value: T) -> Option<T> {
        let mut state = self.lock();
        if state.closed {
            return Some(value);
        }
        let pushed_out = if state.values.len() == self.capacity {
            state.values.pop_front()
        } else {
            None
        };
        state.dropped += u64::from(pushed_out.is_some());
        state.values.push_back(value);
        drop(state);
        self.changed.notify_one();
        pushed_out
    }

    /// The oldest value, if there is one.
    pub fn try_pop(&self) -> Option<T> {
        self.lock().values.pop_front()
    }

    /// Waits for a value; `None` once the queue is closed and empty.
    pub fn pop(&self) -> Option<T> {
        let waiting = |state: &mut State<T>| state.values.is_empty() && !state.closed;
        let state = self.changed.wait_while(self.lock(), waiting);
        state
            .unwrap_or_else(PoisonError::into_inner)
            .values
            .pop_front()
    }

    /// Waits no longer than this for a value.
    pub fn pop_within(&self, patience: Duration) -> Taken<T> {
        let waiting = |state: &mut State<T>| state.values.is_empty() && !state.closed;
        let waited = self
            .changed
            .wait_timeout_while(self.lock(), patience, waiting);
        let (mut state, _) = waited.unwrap_or_else(PoisonError::into_inner);
        match state.values.pop_front() {
            Some(value) => Taken::Value(value),
            None if state.closed => Taken::Closed,
            None => Taken::Nothing,
        }
    }

    /// No value follows: readers get what is left and then `None`.
    pub fn close(&self) {
        self.lock().closed = true;
        self.changed.notify_all();
    }

    /// How many values were pushed out.
    pub fn dropped(&self) -> u64 {
        self.lock().dropped
    }

    /// A panic elsewhere leaves the values whole: each change here is complete before the lock goes.
    fn lock(&self) -> MutexGuard<'_, State<T>> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

#[cfg(test)]
mod tests {
    use std::{sync::Arc, thread};

    use super::*;

    #[test]
    fn the_newest_value_wins_and_replaced_ones_are_counted() {
        let slot = Latest::default();
        assert_eq!(slot.try_take(), None::<u32>);
        assert_eq!(slot.put(1), None);
        assert_eq!(slot.put(2), Some(1));
        assert_eq!((slot.take(), slot.dropped()), (Some(2), 1));
        assert_eq!(slot.take_within(Duration::ZERO), Taken::Nothing);
    }

    #[test]
    fn a_full_queue_gives_up_its_oldest() {
        let queue = DropOldest::new(2);
        let pushed_out: Vec<_> = (0..5).filter_map(|value| queue.push(value)).collect();
        assert_eq!((pushed_out, queue.dropped()), (vec![0, 1, 2], 3));
        queue.close();
        assert_eq!(queue.push(9), Some(9));
        assert_eq!(
            [queue.pop(), queue.pop(), queue.pop()],
            [Some(3), Some(4), None]
        );
        assert_eq!(queue.pop_within(Duration::from_secs(9)), Taken::Closed);
    }

    #[test]
    fn a_waiting_reader_gets_every_value_that_is_not_dropped_and_then_the_end() {
        let queue = Arc::new(DropOldest::new(4));
        let reader = {
            let queue = Arc::clone(&queue);
            thread::Builder::new()
                .spawn(move || std::iter::from_fn(|| queue.pop()).collect::<Vec<u32>>())
                .unwrap()
        };
        for value in 0..1000 {
            queue.push(value);
        }
        queue.close();
        let read = reader.join().unwrap();
        assert_eq!(read.len() as u64 + queue.dropped(), 1000);
        assert!(read.is_sorted() && read.last() == Some(&999));
    }
}
