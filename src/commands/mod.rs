//! One file a command.

pub(crate) mod bench;
pub(crate) mod chain;
pub(crate) mod dataset;
pub(crate) mod demo;
pub(crate) mod evaluate;
pub(crate) mod export;
pub(crate) mod import;
pub(crate) mod info;
pub(crate) mod replay;
pub(crate) mod scene;
pub(crate) mod settings;
pub(crate) mod simulate;
pub(crate) mod train;
