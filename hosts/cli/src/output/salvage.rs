//! A recording whose disk failed: the rows that reached it make a valid file.

use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom, Write};

use asperity_measure::npy;

/// A line of a CSV file is shorter than this.
const LONGEST_LINE: u64 = 1 << 20;

/// Cuts a file of these columns of 32-bit floats (or lines of text) after its last whole row, and makes its header say so. Answers how
/// many rows there are; of a CSV file, nothing.
///
/// # Errors
/// What the disk says; a file whose header did not reach it.
pub fn salvage(file: &mut File, ending: &str, columns: usize) -> io::Result<Option<u64>> {
    let len = file.metadata()?.len();
    match ending {
        "wav" => wav(file, len, columns).map(Some),
        "npy" => npy(file, len, columns).map(Some),
        _ => csv(file, len).map(|()| None),
    }
}

/// The last whole row of a file of this length whose rows begin at `head`.
fn rows(len: u64, head: u64, columns: usize) -> io::Result<u64> {
    let body = len.checked_sub(head).ok_or(io::ErrorKind::UnexpectedEof)?;
    Ok(body / (4 * columns.max(1) as u64))
}

fn wav(file: &mut File, len: u64, columns: usize) -> io::Result<u64> {
    let mut head = Vec::new();
    file.seek(SeekFrom::Start(0))?;
    file.take(256).read_to_end(&mut head)?;
    let at = head.windows(4).position(|w| w == b"data").ok_or(io::ErrorKind::UnexpectedEof)? as u64 + 8;
    let rows = rows(len, at, columns)?;
    let bytes = rows * 4 * columns.max(1) as u64;
    let size = |n: u64| u32::try_from(n).map_err(|_| io::Error::from(io::ErrorKind::FileTooLarge));
    file.set_len(at + bytes)?;
    file.seek(SeekFrom::Start(4))?;
    file.write_all(&size(at + bytes - 8)?.to_le_bytes())?;
    file.seek(SeekFrom::Start(at - 4))?;
    file.write_all(&size(bytes)?.to_le_bytes())?;
    Ok(rows)
}

fn npy(file: &mut File, len: u64, columns: usize) -> io::Result<u64> {
    let mut begin = [0; 10];
    file.seek(SeekFrom::Start(0))?;
    file.read_exact(&mut begin)?;
    let head = 10 + u64::from(u16::from_le_bytes([begin[8], begin[9]]));
    let rows = rows(len, head, columns)?;
    file.set_len(head + rows * 4 * columns.max(1) as u64)?;
    npy::set_rows(file, rows as usize, (columns > 1).then_some(columns))?;
    Ok(rows)
}

fn csv(file: &mut File, len: u64) -> io::Result<()> {
    let from = len.saturating_sub(LONGEST_LINE);
    let mut end = Vec::new();
    file.seek(SeekFrom::Start(from))?;
    file.read_to_end(&mut end)?;
    let whole = end.iter().rposition(|b| *b == b'\n').ok_or(io::ErrorKind::UnexpectedEof)?;
    file.set_len(from + whole as u64 + 1)
}
