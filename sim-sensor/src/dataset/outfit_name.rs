//! What somebody in a data set wears, by name.

use serde::{Deserialize, Serialize};

use crate::person::OutfitKind;

/// The longest name.
const LENGTH: usize = 32;

/// A simulated outfit's name, or what a foreign data set calls one: at most 32 bytes, none of them zero.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub struct OutfitName([u8; LENGTH]);

impl OutfitName {
    pub fn name(&self) -> &str {
        let length = self.0.iter().position(|&byte| byte == 0);
        let bytes = &self.0[..length.unwrap_or(LENGTH)];
        std::str::from_utf8(bytes).unwrap_or_default()
    }
}

impl TryFrom<String> for OutfitName {
    type Error = String;

    fn try_from(name: String) -> Result<Self, String> {
        if name.is_empty() || name.len() > LENGTH || name.contains('\0') {
            return Err(format!(
                "expected an outfit's name of 1 to {LENGTH} bytes, found {name:?}"
            ));
        }
        let mut bytes = [0; LENGTH];
        bytes[..name.len()].copy_from_slice(name.as_bytes());
        Ok(Self(bytes))
    }
}

impl From<OutfitKind> for OutfitName {
    fn from(kind: OutfitKind) -> Self {
        Self::try_from(kind.name().to_owned()).expect("our outfits have short names")
    }
}

impl From<OutfitName> for String {
    fn from(name: OutfitName) -> Self {
        name.name().to_owned()
    }
}

impl PartialEq<OutfitKind> for OutfitName {
    fn eq(&self, kind: &OutfitKind) -> bool {
        self.name() == kind.name()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_survive_json_and_absurd_ones_are_refused() {
        let name = OutfitName::from(OutfitKind::LongsleeveWideTrousers);
        assert_eq!(name, OutfitKind::LongsleeveWideTrousers);
        let text = serde_json::to_string(&name).unwrap();
        assert_eq!(text, "\"longsleeve-wide-trousers\"");
        assert_eq!(serde_json::from_str::<OutfitName>(&text).unwrap(), name);
        let longest = "x".repeat(LENGTH);
        assert_eq!(
            OutfitName::try_from(longest.clone()).unwrap().name(),
            longest
        );
        for wrong in ["", "a\0b", &"x".repeat(LENGTH + 1)] {
            assert!(OutfitName::try_from(wrong.to_owned()).is_err());
        }
    }
}
