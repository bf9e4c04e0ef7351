use std::io;
use std::net::{SocketAddr, ToSocketAddrs};
use std::path::Path;

use thiserror::Error;

/// Where a plant is.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Address {
    /// A command that the shell starts.
    Exec(String),
    /// A program that listens there.
    Tcp(SocketAddr),
}

/// How far away a plant may be.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Reach {
    /// On this machine.
    Here,
    /// On any machine, where anybody on the way can move it.
    Anywhere,
}

/// Why a text is not the address of a plant.
#[derive(Debug, Error)]
pub enum AddressError {
    #[error("write the command after `exec:`")]
    NoCommand,
    #[error("tcp:{place}: {source}; write tcp:HOST:PORT")]
    Place { place: String, source: io::Error },
    #[error("tcp:{0} is another machine, and nothing protects the connection")]
    OtherMachine(String),
}

impl Address {
    /// The address in a text, `exec:COMMAND` or `tcp:HOST:PORT`; `None` if it names a file or a built-in plant.
    ///
    /// # Errors
    /// What is wrong with an address, and the remedy.
    pub fn in_text(text: &Path, reach: Reach) -> Option<Result<Self, AddressError>> {
        let text = text.to_str()?;
        if let Some(command) = text.strip_prefix("exec:") {
            return Some(match command.trim() {
                "" => Err(AddressError::NoCommand),
                command => Ok(Self::Exec(command.into())),
            });
        }
        let place = text.strip_prefix("tcp:")?;
        Some(resolved(place, reach))
    }
}

fn resolved(place: &str, reach: Reach) -> Result<Address, AddressError> {
    let wrong = |source| AddressError::Place {
        place: place.to_owned(),
        source,
    };
    let mut found = place.to_socket_addrs().map_err(wrong)?;
    let address = found.next();
    let address = address.ok_or_else(|| wrong(io::ErrorKind::HostUnreachable.into()))?;
    match address.ip().is_loopback() || reach == Reach::Anywhere {
        true => Ok(Address::Tcp(address)),
        false => Err(AddressError::OtherMachine(place.to_owned())),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Option<Result<Address, String>> {
        let found = Address::in_text(Path::new(text), Reach::Here)?;
        Some(found.map_err(|error| error.to_string()))
    }

    #[test]
    fn an_address_is_a_command_or_a_port_of_this_machine() {
        let command = Address::Exec("python rig.py -r 100".into());
        assert_eq!(read("exec: python rig.py -r 100"), Some(Ok(command)));
        let port = Address::Tcp(([127, 0, 0, 1], 4000).into());
        assert_eq!(read("tcp:127.0.0.1:4000"), Some(Ok(port)));
        assert_eq!(read("pendulum-real"), None);
        for (text, words) in [
            ("exec:", "write the command"),
            ("tcp:127.0.0.1", "write tcp:HOST:PORT"),
            ("tcp:192.0.2.1:4000", "another machine"),
        ] {
            let error = read(text).unwrap().unwrap_err();
            assert!(error.contains(words), "{text}: {error}");
        }
    }
}
