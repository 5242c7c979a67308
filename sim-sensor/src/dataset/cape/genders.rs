//! The file of genders: a Python pickle of one dictionary from text to text, and nothing more is understood.

use std::collections::BTreeMap;

/// No such file has more.
const MOST_STEPS: usize = 100_000;

#[derive(Clone, Debug, PartialEq)]
enum Value {
    Text(String),
    Dictionary(BTreeMap<String, String>),
    Mark,
}

/// Subject to gender, or what is there instead.
pub(super) fn parse(pickle: &[u8]) -> Result<BTreeMap<String, String>, String> {
    let mut reader = Reader { rest: pickle, stack: Vec::new(), memory: BTreeMap::new() };
    for _ in 0..MOST_STEPS {
        if let Some(dictionary) = reader.step()? {
            return Ok(dictionary);
        }
    }
    Err("a pickle that does not end".to_owned())
}

struct Reader<'a> {
    rest: &'a [u8],
    stack: Vec<Value>,
    memory: BTreeMap<u32, Value>,
}

impl Reader<'_> {
    /// One instruction; the result at the end.
    fn step(&mut self) -> Result<Option<BTreeMap<String, String>>, String> {
        let code = self.take(1)?[0];
        match code {
            b'.' => {
                return match self.stack.pop() {
                    Some(Value::Dictionary(dictionary)) => Ok(Some(dictionary)),
                    other => Err(format!("a pickle of {other:?}, not of a dictionary")),
                };
            }
            // Protocol and frame.
            0x80 => drop(self.take(1)?),
            0x95 => drop(self.take(8)?),
            b'(' => self.stack.push(Value::Mark),
            b'}' => self.stack.push(Value::Dictionary(BTreeMap::new())),
            b'd' => {
                let pairs = self.since_mark()?;
                self.stack.push(Value::Dictionary(BTreeMap::new()));
                self.insert(&pairs)?;
            }
            b'u' => {
                let pairs = self.since_mark()?;
                self.insert(&pairs)?;
            }
            b's' => {
                let pair = self.stack.split_off(self.stack.len().saturating_sub(2));
                self.insert(&pair)?;
            }
            b'U' | 0x8c => {
                let length = u32::from(self.take(1)?[0]);
                self.text(length)?;
            }
            b'T' | b'X' => {
                let length = self.number()?;
                self.text(length)?;
            }
            b'S' | b'V' => {
                let line = self.line()?;
                let quotes: &[char] = &['\'', '"'];
                self.stack
                    .push(Value::Text(line.trim_matches(quotes).to_owned()));
            }
            b'q' | b'r' | b'p' | 0x94 => {
                let key = match code {
                    0x94 => self.memory.len() as u32,
                    _ => self.key(code)?,
                };
                let top = self.stack.last().ok_or("nothing to remember")?;
                self.memory.insert(key, top.clone());
            }
            b'h' | b'j' | b'g' => {
                let key = self.key(code)?;
                let value = self.memory.get(&key).ok_or("something never remembered")?;
                self.stack.push(value.clone());
            }
            other => {
                return Err(format!(
                    "pickle instruction {other:#04x}, which no text needs"
                ));
            }
        }
        Ok(None)
    }

    /// Where something is remembered: a byte, four bytes or a line of digits, as the instruction has it.
    fn key(&mut self, code: u8) -> Result<u32, String> {
        match code {
            b'q' | b'h' => Ok(u32::from(self.take(1)?[0])),
            b'p' | b'g' => {
                let line = self.line()?;
                line.parse().map_err(|error| format!("{line:?} ({error})"))
            }
            _ => self.number(),
        }
    }

    fn number(&mut self) -> Result<u32, String> {
        let bytes = self.take(4)?;
        Ok(u32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]]))
    }

    fn text(&mut self, length: u32) -> Result<(), String> {
        let text = String::from_utf8_lossy(self.take(length as usize)?).into_owned();
        self.stack.push(Value::Text(text));
        Ok(())
    }

    fn line(&mut self) -> Result<String, String> {
        let end = self.rest.iter().position(|&byte| byte == b'\n');
        let line = self.take(end.ok_or("an unfinished line")? + 1)?;
        Ok(String::from_utf8_lossy(line).trim_end().to_owned())
    }

    fn take(&mut self, count: usize) -> Result<&[u8], String> {
        let (taken, rest) = self
            .rest
            .split_at_checked(count)
            .ok_or("a pickle cut off")?;
        self.rest = rest;
        Ok(taken)
    }

    fn since_mark(&mut self) -> Result<Vec<Value>, String> {
        let mark = self.stack.iter().rposition(|value| *value == Value::Mark);
        let values = self.stack.split_off(mark.ok_or("no mark")?);
        Ok(values.into_iter().skip(1).collect())
    }

    /// Keys and values in turn, into the dictionary on top.
    fn insert(&mut self, pairs: &[Value]) -> Result<(), String> {
        let Some(Value::Dictionary(dictionary)) = self.stack.last_mut() else {
            return Err("pairs without a dictionary".to_owned());
        };
        for pair in pairs.chunks(2) {
            let [Value::Text(key), Value::Text(value)] = pair else {
                return Err(format!("{pair:?}, not text and text"));
            };
            dictionary.insert(key.clone(), value.clone());
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// `pickle.dumps({"00032": "male", "00096": "female", "00122": "male"}, protocol)`; equal texts are one object.
    const IN_TEXT: &[u8] =
        b"(dp0\nV00032\np1\nVmale\np2\nsV00096\np3\nVfemale\np4\nsV00122\np5\ng2\ns.";
    const BINARY: &[u8] = b"\x80\x02}q\x00(X\x05\x00\x00\x0000032q\x01X\x04\x00\x00\x00maleq\x02\
        X\x05\x00\x00\x0000096q\x03X\x06\x00\x00\x00femaleq\x04X\x05\x00\x00\x0000122q\x05h\x02u.";
    const FRAMED: &[u8] =
        b"\x80\x04\x95\x33\x00\x00\x00\x00\x00\x00\x00}\x94(\x8c\x0500032\x94\x8c\x04male\x94\
        \x8c\x0500096\x94\x8c\x06female\x94\x8c\x0500122\x94h\x02u.";

    #[test]
    fn every_protocol_says_the_same() {
        for pickle in [IN_TEXT, BINARY, FRAMED] {
            let genders = parse(pickle).unwrap();
            let pairs: Vec<_> = genders
                .iter()
                .map(|(a, b)| (a.as_str(), b.as_str()))
                .collect();
            assert_eq!(
                pairs,
                [("00032", "male"), ("00096", "female"), ("00122", "male")]
            );
        }
    }

    #[test]
    fn damage_is_an_error_wherever_it_is() {
        for cut in 0..BINARY.len() {
            assert!(parse(&BINARY[..cut]).is_err());
        }
        assert!(
            parse(b"cos\nsystem\n(S'true'\ntR.").is_err(),
            "nothing is ever called"
        );
        assert!(parse(b"\x80\x02X\xff\xff\xff\xff").is_err());
    }
}
