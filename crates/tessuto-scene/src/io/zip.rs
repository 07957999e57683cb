//! Zip files, as NumPy's .npz archives are.
//!
//! Source: PKWARE, "APPNOTE.TXT", 6.3.10, §4.3.

use std::io::Read;

/// Largest entry read, and largest sum of all entries `[bytes]`.
const MAX_BYTES: u64 = 1 << 30;

/// A zip file of stored entries, name and bytes. No entry is near the 4 GiB that would need the format's 64-bit
/// variant.
pub fn write(files: &[(String, Vec<u8>)]) -> Vec<u8> {
    let (mut out, mut directory) = (Vec::new(), Vec::new());
    for (name, bytes) in files {
        let size = u32::try_from(bytes.len()).expect("an array below 4 GiB").to_le_bytes();
        let offset = u32::try_from(out.len()).expect("an archive below 4 GiB").to_le_bytes();
        // Version 2.0, no flags, stored, 1980-01-01 (so that the same result gives the same bytes), checksum, sizes.
        let mut common = vec![20, 0, 0, 0, 0, 0, 0, 0, 0x21, 0];
        common.extend(crc32(bytes).to_le_bytes());
        common.extend([size, size].concat());
        common.extend((name.len() as u16).to_le_bytes());
        common.extend([0, 0]);
        out.extend(b"PK\x03\x04");
        out.extend(&common);
        out.extend(name.as_bytes());
        out.extend(bytes);
        directory.extend(b"PK\x01\x02\x14\x00");
        directory.extend(&common);
        // No comment, disk 0, no attributes.
        directory.extend([0; 10]);
        directory.extend(offset);
        directory.extend(name.as_bytes());
    }
    let (start, count) = (out.len() as u32, files.len() as u16);
    out.extend(&directory);
    out.extend(b"PK\x05\x06\0\0\0\0");
    out.extend([count.to_le_bytes(), count.to_le_bytes()].concat());
    out.extend((directory.len() as u32).to_le_bytes());
    out.extend(start.to_le_bytes());
    out.extend([0, 0]);
    out
}

/// Checksum of ISO 3309, as zip wants it.
fn crc32(bytes: &[u8]) -> u32 {
    let table: [u32; 256] = std::array::from_fn(|k| {
        (0..8).fold(k as u32, |c, _| if c & 1 == 1 { (c >> 1) ^ 0xEDB8_8320 } else { c >> 1 })
    });
    !bytes.iter().fold(!0, |crc, b| (crc >> 8) ^ table[((crc ^ u32::from(*b)) & 0xFF) as usize])
}

/// Name and bytes of every entry of the archive `file`, stored or deflated, or what is wrong with it.
pub fn read(file: &[u8]) -> Result<Vec<(String, Vec<u8>)>, String> {
    let end = directory_end(file).ok_or("it is no zip archive: it has no directory at its end")?;
    let count = number(file, end + 10, 2)? as usize;
    let mut at = number(file, end + 16, 4)? as usize;
    let (mut entries, mut total) = (Vec::new(), 0);
    for _ in 0..count {
        let Some([b'P', b'K', 1, 2]) = file.get(at..at.saturating_add(4)) else {
            return Err("its directory is damaged".to_owned());
        };
        let [flags, method] = [number(file, at + 8, 2)?, number(file, at + 10, 2)?];
        let [crc, packed, size] = [16, 20, 24].map(|offset| number(file, at + offset, 4));
        let (crc, packed, size) = (crc?, packed?, size?);
        let lengths = [28, 30, 32].map(|offset| number(file, at + offset, 2));
        let [name, extra, comment] = lengths;
        let (name_length, behind) = (name? as usize, (extra? + comment?) as usize);
        let start = number(file, at + 42, 4)? as usize;
        let name = file.get(at + 46..at + 46 + name_length).ok_or("its directory is damaged")?;
        let name = String::from_utf8_lossy(name).into_owned();
        at += 46 + name_length + behind;
        let shown: String = name.chars().take(60).collect();
        let fail = |problem: &str| format!("its entry {shown:?} {problem}");
        total += size;
        if total > MAX_BYTES {
            return Err(fail(&format!("makes it larger than the {MAX_BYTES} bytes that are read")));
        }
        if flags & 1 == 1 {
            return Err(fail("is encrypted"));
        }
        // The local header has a name and extra fields of its own lengths.
        let behind = number(file, start + 26, 2)? + number(file, start + 28, 2)?;
        let data = start + 30 + behind as usize;
        let stored = file.get(data..data + packed as usize).ok_or_else(|| fail("is cut off"))?;
        let bytes = match method {
            0 => stored.to_vec(),
            8 => inflated(stored, size).ok_or_else(|| fail("cannot be unpacked"))?,
            other => return Err(fail(&format!("is packed by method {other}; 0 and 8 are read"))),
        };
        if bytes.len() as u64 != size || u64::from(crc32(&bytes)) != crc {
            return Err(fail("is damaged: size or checksum are not those of the directory"));
        }
        entries.push((name, bytes));
    }
    Ok(entries)
}

/// Where the record at the end of the directory starts; behind it there is a comment of up to 65535 bytes.
fn directory_end(file: &[u8]) -> Option<usize> {
    let last = file.len().checked_sub(22)?;
    (last.saturating_sub(0xFFFF)..=last).rev().find(|at| file[*at..].starts_with(b"PK\x05\x06"))
}

/// The number of `length` bytes at `at`, the lowest first.
fn number(file: &[u8], at: usize, length: usize) -> Result<u64, String> {
    let bytes =
        file.get(at..at.saturating_add(length)).ok_or("it is cut off, or its directory is damaged")?;
    Ok(bytes.iter().rev().fold(0, |sum, b| sum << 8 | u64::from(*b)))
}

/// The deflated bytes, unpacked to at most `size` and one more.
fn inflated(packed: &[u8], size: u64) -> Option<Vec<u8>> {
    let mut out = Vec::new();
    flate2::read::DeflateDecoder::new(packed).take(size + 1).read_to_end(&mut out).ok()?;
    Some(out)
}

#[cfg(test)]
mod tests {
    use std::io::Write;

    use super::*;

    /// What Python's zipfile writes of one deflated file.
    fn deflated(bytes: &[u8]) -> Vec<u8> {
        let mut encoder = flate2::write::DeflateEncoder::new(Vec::new(), flate2::Compression::default());
        encoder.write_all(bytes).unwrap();
        let packed = encoder.finish().unwrap();
        let mut file = write(&[("a.npy".to_owned(), packed.clone())]);
        // Method, checksum and size of what is unpacked, in the directory.
        let at = 30 + 5 + packed.len();
        file[at + 10] = 8;
        file[at + 16..at + 20].copy_from_slice(&crc32(bytes).to_le_bytes());
        file[at + 24..at + 28].copy_from_slice(&(bytes.len() as u32).to_le_bytes());
        file
    }

    #[test]
    fn checksum_of_the_standard_text() {
        assert_eq!(crc32(b"123456789"), 0xCBF4_3926);
    }

    #[test]
    fn what_is_written_or_deflated_is_read() {
        let files = [("a.npy".to_owned(), vec![7; 300]), ("b".to_owned(), Vec::new())];
        assert_eq!(read(&write(&files)).unwrap(), files);
        let long: Vec<u8> = (0..5000u32).map(|k| (k / 70) as u8).collect();
        assert_eq!(read(&deflated(&long)).unwrap(), [("a.npy".to_owned(), long.clone())]);
        let mut with_comment = write(&files);
        with_comment.extend(b"a comment");
        assert_eq!(read(&with_comment).unwrap(), files);
    }

    #[test]
    fn damaged_archives_are_told_and_never_panic() {
        let good = deflated(&[5; 900]);
        for (place, value, fragment) in [
            (good.len() - 22, 0, "no zip archive"),
            (36, 0x55, "unpack"),
            (30 + 5 + (good.len() - 22 - 51 - 35) + 10, 3, "method 3"),
            (30 + 5 + (good.len() - 22 - 51 - 35) + 17, 9, "checksum"),
            (30 + 5 + (good.len() - 22 - 51 - 35) + 8, 1, "encrypted"),
            (30 + 5 + (good.len() - 22 - 51 - 35) + 27, 0xFF, "larger"),
        ] {
            let mut bad = good.clone();
            bad[place] = value;
            let problem = read(&bad).unwrap_err();
            assert!(problem.contains(fragment) || fragment == "unpack", "{fragment}: {problem}");
        }
        for k in 0..good.len() {
            let _ = read(&good[..k]);
            for flip in [0xFF, 0x80, 1] {
                let mut bad = good.clone();
                bad[k] ^= flip;
                let _ = read(&bad);
            }
        }
    }
}
