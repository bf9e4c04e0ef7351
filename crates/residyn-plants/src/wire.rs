use std::io::{self, BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::process::{Child, ChildStdin, Command, ExitStatus, Stdio};
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, TryRecvError, sync_channel};
use std::thread;
use std::time::{Duration, Instant};

use super::address::Address;
use super::error::RemoteError;
use super::message::{FromPlant, LONGEST_LINE, ToPlant};

/// Lines that wait to be read. A plant that sends more has to wait.
pub(super) const MOST_WAITING: usize = 1024;
/// How long a plant may take to end after it was told to stop.
const ENDING: Duration = Duration::from_secs(2);
const CONNECTING: Duration = Duration::from_secs(5);

/// Messages to and from a plant, one on a line.
pub struct Wire {
    out: Out,
    lines: Receiver<Line>,
    read: usize,
    child: Option<Child>,
}

enum Out {
    Pipe(Option<ChildStdin>),
    Stream(TcpStream),
}

/// What the reading thread found.
enum Line {
    Whole(Vec<u8>),
    TooLong,
    Failed(io::Error),
}

impl Wire {
    /// Start the plant, or connect to it.
    ///
    /// # Errors
    /// A plant that cannot be reached.
    pub fn open(address: &Address) -> Result<Self, RemoteError> {
        match address {
            Address::Exec(command) => Self::exec(command)
                .map_err(|source| unreachable_plant(command, source, "is the command right?")),
            Address::Tcp(place) => {
                let stream = TcpStream::connect_timeout(place, CONNECTING);
                let wire = stream.and_then(Self::stream);
                wire.map_err(|source| {
                    unreachable_plant(&place.to_string(), source, "start it first, with --tcp")
                })
            }
        }
    }

    fn exec(command: &str) -> io::Result<Self> {
        // `exec`: the plant takes the place of the shell, and is what is killed in the end.
        let mut child = Command::new("sh")
            .args(["-c", &format!("exec {command}")])
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()?;
        let stdout = child.stdout.take().expect("it is piped");
        Ok(Self {
            out: Out::Pipe(child.stdin.take()),
            lines: lines_of(stdout),
            read: 0,
            child: Some(child),
        })
    }

    fn stream(stream: TcpStream) -> io::Result<Self> {
        stream.set_nodelay(true)?;
        Ok(Self {
            lines: lines_of(stream.try_clone()?),
            out: Out::Stream(stream),
            read: 0,
            child: None,
        })
    }

    /// Number of the line that was read last, from 1.
    pub fn line(&self) -> usize {
        self.read
    }

    /// Send a message.
    ///
    /// # Errors
    /// A plant that has ended.
    pub fn send(&mut self, message: &ToPlant<'_>) -> Result<(), RemoteError> {
        let mut line = serde_json::to_vec(message).expect("numbers and texts");
        line.push(b'\n');
        let sent = match &mut self.out {
            Out::Pipe(Some(pipe)) => pipe.write_all(&line).and_then(|()| pipe.flush()),
            Out::Pipe(None) => Ok(()),
            Out::Stream(stream) => stream.write_all(&line),
        };
        // Its last words say more than a broken pipe.
        match sent {
            Ok(()) => Ok(()),
            Err(_) => Err(self.last_words()),
        }
    }

    /// The next message, within `patience`.
    ///
    /// # Errors
    /// Silence, the end of the plant, and lines that are not messages.
    pub fn receive(&mut self, patience: Duration) -> Result<FromPlant, RemoteError> {
        match self.lines.recv_timeout(patience) {
            Ok(line) => self.message(line),
            Err(RecvTimeoutError::Timeout) => Err(RemoteError::Silent(patience)),
            Err(RecvTimeoutError::Disconnected) => Err(self.ended()),
        }
    }

    /// A message that has already arrived.
    ///
    /// # Errors
    /// As [`Wire::receive`].
    pub fn waiting(&mut self) -> Result<Option<FromPlant>, RemoteError> {
        match self.lines.try_recv() {
            Ok(line) => self.message(line).map(Some),
            Err(TryRecvError::Empty) => Ok(None),
            Err(TryRecvError::Disconnected) => Err(self.ended()),
        }
    }

    /// Tell the plant to stop, and see to it that a plant that was started here ends.
    pub fn close(&mut self) {
        if self.send(&ToPlant::Stop).is_ok() {
            let until = Instant::now() + ENDING;
            while let Some(left) = until.checked_duration_since(Instant::now()) {
                if matches!(self.receive(left), Ok(FromPlant::Stopped) | Err(_)) {
                    break;
                }
            }
        }
        // The end of its input tells it once more.
        if let Out::Pipe(pipe) = &mut self.out {
            pipe.take();
        }
        if self.status().is_none()
            && let Some(mut child) = self.child.take()
        {
            // It was told twice.
            let _ = child.kill();
            let _ = child.wait();
        }
    }

    /// How a plant that was started here ended; `None` if it does not end soon.
    fn status(&mut self) -> Option<ExitStatus> {
        let child = self.child.as_mut()?;
        let until = Instant::now() + ENDING;
        while Instant::now() < until {
            if let Some(status) = child.try_wait().ok()? {
                return Some(status);
            }
            thread::sleep(Duration::from_millis(5));
        }
        None
    }

    fn message(&mut self, line: Line) -> Result<FromPlant, RemoteError> {
        self.read += 1;
        let malformed = |fault: String| RemoteError::Malformed {
            line: self.read,
            fault,
        };
        let message = match line {
            Line::Whole(line) => serde_json::from_slice(&line),
            Line::TooLong => {
                return Err(malformed(format!("it is longer than {LONGEST_LINE} bytes")));
            }
            Line::Failed(error) => return Err(malformed(error.to_string())),
        };
        match message.map_err(|error| malformed(error.to_string()))? {
            FromPlant::Error { message } => Err(RemoteError::OfPlant(printable(&message))),
            message => Ok(message),
        }
    }

    /// The error that the plant had sent when it went, or that it has gone.
    fn last_words(&mut self) -> RemoteError {
        let until = Instant::now() + ENDING;
        while Instant::now() < until {
            if let Err(error) = self.receive(ENDING) {
                return error;
            }
        }
        self.ended()
    }

    fn ended(&mut self) -> RemoteError {
        let status = self.status();
        RemoteError::Ended(status.map_or_else(String::new, |status| format!(" ({status})")))
    }
}

impl Drop for Wire {
    fn drop(&mut self) {
        self.close();
    }
}

/// A text of a plant, for a terminal.
fn printable(text: &str) -> String {
    let plain = text.chars().take(2000);
    plain
        .map(|c| if c.is_control() { ' ' } else { c })
        .collect()
}

fn unreachable_plant(plant: &str, source: io::Error, remedy: &'static str) -> RemoteError {
    RemoteError::Unreachable {
        plant: plant.to_owned(),
        source,
        remedy,
    }
}

fn lines_of(input: impl Read + Send + 'static) -> Receiver<Line> {
    let (lines, received) = sync_channel(MOST_WAITING);
    thread::spawn(move || read(BufReader::new(input), &lines));
    received
}

fn read(mut input: impl BufRead, lines: &SyncSender<Line>) {
    loop {
        let mut bytes = Vec::new();
        let most = LONGEST_LINE as u64;
        let line = match (&mut input).take(most).read_until(b'\n', &mut bytes) {
            Ok(0) => return,
            Ok(_) if bytes.ends_with(b"\n") => Line::Whole(bytes),
            Ok(read) if read == LONGEST_LINE => Line::TooLong,
            // A line without its end: the plant died in the middle of it.
            Ok(_) => return,
            Err(error) => Line::Failed(error),
        };
        let is_last = !matches!(line, Line::Whole(_));
        if lines.send(line).is_err() || is_last {
            return;
        }
    }
}
