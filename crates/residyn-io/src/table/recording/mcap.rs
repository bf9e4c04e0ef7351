//! MCAP, read from its beginning to the end of its data, with or without an index, in chunks or not.

use std::borrow::Cow;
use std::io::Read;
use std::path::Path;

use ::mcap::read::{ChannelAccumulator, parse_record};
use ::mcap::records::{Record, op};
use ::mcap::sans_io::{LinearReadEvent, LinearReader, LinearReaderOptions};
use ::mcap::{McapError, McapResult};

use super::Recording;
use crate::files;
use residyn_core::data::LogError;
use residyn_core::limits::{RECORD_BYTES, unpacked_bytes};

pub(super) fn read(path: &Path, recording: &mut Recording) -> Result<(), LogError> {
    match add(path, recording) {
        Ok(()) => Ok(()),
        Err(McapError::UnexpectedEof) => {
            recording.notes.push(format!(
                "{} is cut off: only the part before the cut is read",
                path.display()
            ));
            Ok(())
        }
        Err(McapError::Io(why)) => Err(LogError::open(path)(why)),
        Err(why) => Err(LogError::form(
            path,
            format!(
                "is damaged: {why}; save what is left: `mcap recover run.mcap --output mended.mcap`"
            ),
        )),
    }
}

fn add(path: &Path, recording: &mut Recording) -> McapResult<()> {
    let mut file = files::open(path)?;
    let packed = file.metadata()?.len();
    recording.extend(packed);
    // A damaged length, or a part that holds more than it seems to, must not take all memory.
    let fits = usize::try_from(unpacked_bytes(packed));
    let largest = fits.map_or(RECORD_BYTES, |bytes| bytes.min(RECORD_BYTES));
    let mut reader = LinearReader::new_with_options(
        LinearReaderOptions::default()
            .with_prevalidate_chunk_crcs(true)
            .with_record_length_limit(largest),
    );
    let mut channels = ChannelAccumulator::default();
    while let Some(event) = reader.next_event() {
        match event? {
            LinearReadEvent::ReadRequest(size) => {
                let read = file.read(reader.insert(size))?;
                reader.notify_read(read);
            }
            // An index follows.
            LinearReadEvent::Record { opcode, .. } if opcode == op::DATA_END => break,
            LinearReadEvent::Record { opcode, data } => {
                if recording.unpacked.take(data.len() as u64).is_err() {
                    break;
                }
                if !is_whole(opcode, data) {
                    return Err(McapError::UnexpectedEoc);
                }
                if [op::SCHEMA, op::CHANNEL, op::MESSAGE, op::METADATA].contains(&opcode) {
                    add_record(parse_record(opcode, data)?, &mut channels, recording)?;
                }
            }
        }
    }
    Ok(())
}

/// Whether the texts of a record are no longer than the record, since memory is allocated for them before they are
/// read.
fn is_whole(opcode: u8, data: &[u8]) -> bool {
    let are_whole = |data, count| fields(data).take(count).all(|field| field.is_some());
    match opcode {
        // After its number: name, encoding, definition.
        op::SCHEMA => data.get(2..).is_some_and(|data| are_whole(data, 3)),
        // After the numbers of channel and schema: topic, encoding, texts about them.
        op::CHANNEL => data.get(4..).is_some_and(|data| {
            let about = fields(data).nth(2).flatten().unwrap_or_default();
            are_whole(data, 3) && are_whole(about, usize::MAX)
        }),
        // Its name, and texts by name.
        op::METADATA => {
            let texts = fields(data).nth(1).flatten().unwrap_or_default();
            are_whole(data, 2) && are_whole(texts, usize::MAX)
        }
        _ => true,
    }
}

/// Fields preceded by their lengths; `None`, and nothing after it, if a field is longer than the data.
fn fields(mut data: &[u8]) -> impl Iterator<Item = Option<&[u8]>> {
    std::iter::from_fn(move || {
        if data.is_empty() {
            return None;
        }
        let split = data
            .split_first_chunk()
            .and_then(|(length, rest)| rest.split_at_checked(u32::from_le_bytes(*length) as usize));
        data = split.map_or(&[][..], |(_, rest)| rest);
        Some(split.map(|(field, _)| field))
    })
}

fn add_record(
    record: Record<'_>,
    channels: &mut ChannelAccumulator<'static>,
    recording: &mut Recording,
) -> McapResult<()> {
    match record {
        Record::Schema { header, data } => {
            channels.add_schema(header, Cow::Owned(data.into_owned()))?;
        }
        Record::Channel(channel) => channels.add_channel(channel)?,
        Record::Message { header, data } => {
            let (message, id) = (header.sequence, header.channel_id);
            let channel = channels
                .get(id)
                .ok_or(McapError::UnknownChannel(message, id))?;
            let kind = channel.schema.as_ref().map_or("", |schema| &schema.name);
            let topic = recording.topic(&channel.topic, kind, &channel.message_encoding);
            recording.add(topic, header.log_time.cast_signed(), &data);
        }
        Record::Metadata(about) => {
            let texts = about.metadata.into_iter();
            let numbers = texts.filter_map(|(name, text)| Some((name, text.parse().ok()?)));
            let is_finite = |(_, number): &(String, f64)| number.is_finite();
            recording.values.extend(numbers.filter(is_finite));
        }
        _ => {}
    }
    Ok(())
}
