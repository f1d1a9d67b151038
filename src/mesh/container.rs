//! What holds a glTF document together: the chunks of a GLB, and the names of the files beside it. Meshes and maps are both
//! read through it.

use std::path::{Component, PathBuf};

/// The JSON chunk and the binary chunk of a GLB (glTF 2.0, section 4.4). Chunks of other kinds are skipped, as demanded there.
///
/// # Errors
/// A clause that says what does not fit.
pub(crate) fn split_glb(bytes: &[u8]) -> Result<(&[u8], Option<&[u8]>), String> {
    let word = |at: usize| -> Option<usize> {
        let four = bytes.get(at..at.checked_add(4)?)?;
        Some(u32::from_le_bytes(four.try_into().ok()?) as usize)
    };
    let short = || "the file ends in the middle of its header".to_owned();
    let version = word(4).ok_or_else(short)?;
    let length = word(8).ok_or_else(short)?;
    if version != 2 {
        return Err(format!("it is GLB version {version}; version 2 is read"));
    }
    if length > bytes.len() {
        return Err(format!(
            "it says it is {length} bytes long, but only {} are there",
            bytes.len()
        ));
    }
    let chunk = |at: usize| -> Result<&[u8], String> {
        let size = word(at).ok_or_else(short)?;
        bytes
            .get(at + 8..)
            .and_then(|rest| rest.get(..size))
            .ok_or_else(|| format!("its chunk at byte {at} reaches beyond the end of the file"))
    };
    let kind_is = |at: usize, kind: &[u8]| bytes.get(at + 4..at + 8) == Some(kind);
    if !kind_is(12, b"JSON") {
        return Err("its first chunk is not JSON".to_owned());
    }
    let json = chunk(12)?;
    let next = 20 + json.len();
    let bin = (next < length && kind_is(next, b"BIN\0"))
        .then(|| chunk(next))
        .transpose()?;
    Ok((json, bin))
}

/// The relative path that a URI means, if it stays inside the folder: no scheme, no root, no `..`.
pub(crate) fn path_beside(uri: &str) -> Option<PathBuf> {
    let decoded = percent_decoded(uri)?;
    let path = PathBuf::from(&decoded);
    let inside = path
        .components()
        .all(|c| matches!(c, Component::Normal(_) | Component::CurDir));
    (inside && !decoded.is_empty() && !decoded.contains(['\\', ':', '\0'])).then_some(path)
}

fn percent_decoded(uri: &str) -> Option<String> {
    let mut bytes = Vec::with_capacity(uri.len());
    let mut rest = uri.bytes();
    while let Some(b) = rest.next() {
        if b == b'%' {
            let mut digit = || char::from(rest.next()?).to_digit(16);
            bytes.push((digit()? * 16 + digit()?) as u8);
        } else {
            bytes.push(b);
        }
    }
    String::from_utf8(bytes).ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn chunks_that_do_not_fit_are_no_glb() {
        let mut bytes = b"glTF\x02\0\0\0\x18\0\0\0\x04\0\0\0JSON{}  ".to_vec();
        assert_eq!(split_glb(&bytes), Ok((b"{}  ".as_slice(), None)));
        bytes[8] = 0x1c;
        assert!(split_glb(&bytes).unwrap_err().contains("28 bytes long"));
        bytes.extend([0xff, 0xff, 0xff, 0xff]);
        bytes.extend(b"BIN\0");
        assert!(split_glb(&bytes).unwrap_err().contains("chunk at byte 24"));
        bytes[4] = 1;
        assert!(split_glb(&bytes).unwrap_err().contains("version 1"));
        assert!(split_glb(b"glTF").is_err());
    }

    #[test]
    fn names_are_decoded_and_stay_in_the_folder() {
        assert_eq!(path_beside("a%20b.png"), Some(PathBuf::from("a b.png")));
        for uri in [
            "../x.png",
            "/etc/x.png",
            "%2e%2e/x.png",
            "file:///x.png",
            "a%2",
            "%ff",
            "%+f",
            "",
        ] {
            assert_eq!(path_beside(uri), None, "{uri}");
        }
    }
}
