//! Messages that rosbridge cut into pieces.

use std::collections::VecDeque;

use serde::Deserialize;

use super::{MAX_MESSAGE, RosbridgeError};

/// Most pieces of a message.
const MOST_PIECES: usize = 65_536;
/// Messages whose pieces are kept at a time; the oldest makes room.
const MOST_MESSAGES: usize = 4;

/// A piece: `{"op":"fragment","id":…,"data":…,"num":…,"total":…}`.
#[derive(Debug, Deserialize)]
pub(super) struct Fragment {
    /// A number or a text, the same in all pieces.
    id: serde_json::Value,
    data: String,
    num: usize,
    total: usize,
}

#[derive(Debug)]
struct Parts {
    id: serde_json::Value,
    pieces: Vec<Option<String>>,
    missing: usize,
    bytes: usize,
}

/// Pieces until they are whole: no more than four messages, together no longer than one may be.
#[derive(Debug, Default)]
pub(super) struct Fragments {
    messages: VecDeque<Parts>,
}

impl Fragments {
    /// Takes a piece. Gives the whole message with the last one.
    pub fn push(&mut self, fragment: Fragment) -> Result<Option<String>, RosbridgeError> {
        let Fragment { id, data, num, total } = fragment;
        if total == 0 || total > MOST_PIECES || num >= total {
            return Err(RosbridgeError::malformed(format!("fragment {num} of {total}")));
        }
        let known = self.messages.iter().position(|parts| parts.id == id && parts.pieces.len() == total);
        let index = known.unwrap_or_else(|| {
            if self.messages.len() == MOST_MESSAGES {
                self.messages.pop_front();
            }
            let pieces = std::iter::repeat_with(|| None).take(total).collect();
            self.messages.push_back(Parts { id, pieces, missing: total, bytes: 0 });
            self.messages.len() - 1
        });
        let parts = &mut self.messages[index];
        if parts.pieces[num].is_none() {
            parts.missing -= 1;
            parts.bytes += data.len();
            parts.pieces[num] = Some(data);
        }
        if parts.missing == 0 {
            let parts = self.messages.remove(index);
            return Ok(parts.map(|parts| parts.pieces.into_iter().flatten().collect()));
        }
        let held: usize = self.messages.iter().map(|parts| parts.bytes).sum();
        if held > MAX_MESSAGE {
            return Err(RosbridgeError::malformed(format!("fragments of {held} bytes, at most {MAX_MESSAGE}")));
        }
        Ok(None)
    }
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    fn piece(id: u32, num: usize, total: usize, data: &str) -> Fragment {
        serde_json::from_value(json!({"op": "fragment", "id": id, "num": num, "total": total, "data": data}))
            .expect("a fragment")
    }

    #[test]
    fn pieces_of_two_messages_in_any_order_and_twice_make_both() {
        let mut fragments = Fragments::default();
        for (fragment, whole) in [
            (piece(1, 2, 3, "c"), None),
            (piece(2, 0, 2, "x"), None),
            (piece(1, 0, 3, "a"), None),
            (piece(1, 0, 3, "a"), None),
            (piece(2, 1, 2, "y"), Some("xy")),
            (piece(1, 1, 3, "b"), Some("abc")),
        ] {
            assert_eq!(fragments.push(fragment).expect("a fragment").as_deref(), whole);
        }
        assert!(fragments.messages.is_empty());
    }

    #[test]
    fn pieces_that_never_become_whole_are_bounded() {
        let mut fragments = Fragments::default();
        for id in 0..1000 {
            fragments.push(piece(id, 0, 2, "half")).expect("a fragment");
        }
        assert_eq!(fragments.messages.len(), MOST_MESSAGES);
        assert!(fragments.push(piece(1, 2, 2, "")).is_err());
        assert!(fragments.push(piece(1, 0, 0, "")).is_err());
        assert!(fragments.push(piece(1, 0, usize::MAX, "")).is_err());
        let long = "x".repeat(MAX_MESSAGE / 4);
        let results: Vec<_> = (0..5).map(|num| fragments.push(piece(7, num, 6, &long)).is_ok()).collect();
        assert_eq!(results, [true, true, true, false, false]);
    }
}
