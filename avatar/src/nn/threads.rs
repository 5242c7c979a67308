//! The thread pool that training owns, so that live stages never wait behind it.

use std::{fmt, sync::Arc};

use serde::{Deserialize, Serialize};

use crate::error::AvatarError;

/// How many threads training may use.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ThreadsConfig {
    /// Threads of the pool; 0 means one a core. Results do not depend on it.
    pub count: usize,
}

impl Default for ThreadsConfig {
    fn default() -> Self {
        Self { count: 2 }
    }
}

/// A named pool.
#[derive(Clone)]
pub struct Threads {
    pool: Arc<rayon::ThreadPool>,
}

impl Threads {
    /// Builds the pool; `at_start` runs once on each thread (the place to lower its priority).
    #[expect(
        clippy::trivially_copy_pass_by_ref,
        reason = "configurations are lent everywhere"
    )]
    pub fn new(
        config: &ThreadsConfig,
        at_start: impl Fn() + Send + Sync + 'static,
    ) -> Result<Self, AvatarError> {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(config.count)
            .thread_name(|index| format!("train-{index}"))
            .start_handler(move |_| at_start())
            .build()
            .map_err(|source| AvatarError::Threads { count: config.count, source })?;
        Ok(Self { pool: Arc::new(pool) })
    }

    /// Runs `work` inside the pool and waits for it.
    pub fn run<R: Send>(&self, work: impl FnOnce() -> R + Send) -> R {
        self.pool.install(work)
    }

    pub fn count(&self) -> usize {
        self.pool.current_num_threads()
    }
}

impl fmt::Debug for Threads {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Threads({})", self.count())
    }
}
