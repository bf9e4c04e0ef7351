use std::path::Path;
use std::sync::{Mutex, PoisonError};

use super::address::Address;
use super::description::{Clock, Description};
use super::error::RemoteError;
use super::remote::{Lateness, Remote};
use residyn_control::control::{DriveError, Driven};

/// Plants of one address: a command is started as often as plants are driven at the same time.
pub struct Fleet {
    address: Address,
    description: Description,
    idle: Mutex<Vec<Remote>>,
    /// Of the newest episode.
    lateness: Mutex<Lateness>,
}

impl Fleet {
    /// Reach the first plant.
    ///
    /// # Errors
    /// As [`Remote::open`].
    pub fn open(address: Address) -> Result<Self, RemoteError> {
        let first = Remote::open(&address)?;
        Ok(Self {
            address,
            description: first.description().clone(),
            idle: Mutex::new(vec![first]),
            lateness: Mutex::default(),
        })
    }

    /// What the plants say of themselves.
    pub fn description(&self) -> &Description {
        &self.description
    }

    /// Whether it has only one plant: a program that listens, or a machine that moves by itself.
    pub fn is_single(&self) -> bool {
        matches!(self.address, Address::Tcp(_)) || self.description.clock == Clock::Wall
    }

    /// How late the commands of the newest episode came.
    pub fn lateness(&self) -> Lateness {
        let lateness = self.lateness.lock();
        lateness.unwrap_or_else(PoisonError::into_inner).clone()
    }

    /// Do something with a plant that begins an episode, at `start` if it can be put there; its rows are kept in `log` as
    /// they come. A plant that fails is closed.
    ///
    /// # Errors
    /// As [`Remote::begin`] and [`Remote::end`], and those of what is done.
    pub fn during<T, E: From<DriveError>>(
        &self,
        start: Option<&[f64]>,
        seed: u64,
        log: Option<&Path>,
        act: impl FnOnce(&mut dyn Driven) -> Result<T, E>,
    ) -> Result<T, E> {
        let failed = |error: RemoteError| E::from(error.into());
        let mut plant = self.take().map_err(failed)?;
        let start = start.filter(|_| self.description.clock == Clock::Simulated);
        plant.begin(seed, start, log).map_err(failed)?;
        let done = act(&mut plant);
        plant.end().map_err(failed)?;
        let done = done?;
        let newest = plant.lateness().clone();
        *self.lateness.lock().unwrap_or_else(PoisonError::into_inner) = newest;
        self.idle().push(plant);
        Ok(done)
    }

    fn take(&self) -> Result<Remote, RemoteError> {
        let idle = self.idle().pop();
        idle.map_or_else(|| Remote::open(&self.address), Ok)
    }

    fn idle(&self) -> std::sync::MutexGuard<'_, Vec<Remote>> {
        self.idle.lock().unwrap_or_else(PoisonError::into_inner)
    }
}
