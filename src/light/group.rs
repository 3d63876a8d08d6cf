//! Light groups: the picture has a separate layer for the light of each group.

/// Maximum number of light groups in a scene. A light group is a named set of lights whose light gets a layer of its
/// own, which takes memory in every pixel.
pub const MAX_GROUPS: usize = 64;
/// Maximum length of a light group's name in letters. `ViewLayer.FinishedLightGroup_NAME.R` then has 63 letters,
/// Blender's limit for a channel name.
pub const MAX_GROUP_NAME: usize = 32;

/// Index of a light group (a named set of lights with a layer of its own) in its scene, or no group.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Group(u8);

impl Group {
    /// The value of lights that are in no light group.
    pub const NONE: Group = Group(0);

    /// The value of the light group with this index, which is below [`MAX_GROUPS`].
    pub fn new(index: usize) -> Group {
        Group(u8::try_from(index + 1).unwrap_or(0))
    }

    /// Index of the light group in [`Groups::names`]; `None` for [`Group::NONE`].
    #[inline]
    pub fn index(self) -> Option<usize> {
        self.0.checked_sub(1).map(usize::from)
    }
}

/// The light groups of a scene (named sets of lights, each with a layer), and the group of each light.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Groups {
    /// Name of each light group in the names of its layers: unique, of ASCII letters, digits and `_`.
    pub names: Vec<String>,
    /// Name of each light group in the scene file, by the index of the group.
    labels: Vec<String>,
    /// Light group of each emissive instance (object), by the index of the instance.
    pub instances: Vec<Group>,
    /// Light group of each point, spot and sun, in the order of the emitters.
    pub others: Vec<Group>,
    /// Light group of the environment.
    pub environment: Group,
}

impl Groups {
    /// The light group with the name `label` in the scene file; a new name adds a group. `None` if the name is new and
    /// there are already [`MAX_GROUPS`] groups.
    pub fn get_or_add(&mut self, label: &str) -> Option<Group> {
        let index = match self.labels.iter().position(|known| known == label) {
            Some(index) => index,
            None if self.labels.len() == MAX_GROUPS => return None,
            None => {
                self.names.push(self.free_name(label));
                self.labels.push(label.to_owned());
                self.labels.len() - 1
            }
        };
        Some(Group::new(index))
    }

    /// The light groups whose names were truncated or numbered to make layer names: the name in the scene file, and the
    /// name in layers.
    pub fn renamed(&self) -> impl Iterator<Item = (&str, &str)> {
        let pairs = self.labels.iter().zip(&self.names);
        pairs.filter(|(label, name)| legal(label) != **name).map(|(label, name)| (&**label, &**name))
    }

    /// A unique layer name for the light group `label`: illegal letters become `_`, long names are truncated, and names
    /// that are taken get a number.
    fn free_name(&self, label: &str) -> String {
        let letters = legal(label);
        let mut name = letters[..letters.len().min(MAX_GROUP_NAME)].to_owned();
        for number in 2.. {
            if !self.names.contains(&name) {
                break;
            }
            let suffix = format!("_{number}");
            name = letters[..letters.len().min(MAX_GROUP_NAME - suffix.len())].to_owned() + &suffix;
        }
        name
    }
}

/// Replaces every letter of a light group's name that a layer's name cannot have by `_`.
fn legal(label: &str) -> String {
    label.chars().map(|c| if c.is_ascii_alphanumeric() { c } else { '_' }).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn labels_become_legal_names_and_the_number_of_groups_is_limited() {
        let mut groups = Groups::default();
        let [key, rim, other, again] =
            ["Key light", "rim", "Key.light", "Key light"].map(|name| groups.get_or_add(name));
        assert_eq!((key, rim, again), (Some(Group::new(0)), Some(Group::new(1)), key));
        assert_eq!(other, Some(Group::new(2)));
        assert_eq!(groups.names, ["Key_light", "rim", "Key_light_2"]);
        assert_eq!(groups.renamed().collect::<Vec<_>>(), [("Key.light", "Key_light_2")]);
        assert_eq!((Group::NONE.index(), Group::new(63).index()), (None, Some(63)));
        (3..MAX_GROUPS).for_each(|index| assert!(groups.get_or_add(&index.to_string()).is_some()));
        assert_eq!(groups.get_or_add("one more"), None);
    }

    #[test]
    fn names_are_short_legal_and_unique_for_any_labels() {
        let mut groups = Groups::default();
        let long = "a".repeat(40);
        let labels = ["\u{4e3b}\u{5149}", "\u{9006}\u{5149}", "__", "___2", &long, &long[1..], &long[..32], "a_2", ""];
        let of: Vec<_> = labels.iter().map(|label| groups.get_or_add(label).and_then(Group::index)).collect();
        assert_eq!(of, (0..labels.len()).map(Some).collect::<Vec<_>>());
        let mut names = groups.names.clone();
        names.sort_unstable();
        names.dedup();
        assert_eq!(names.len(), labels.len(), "{:?}", groups.names);
        let legal = |c: char| c.is_ascii_alphanumeric() || c == '_';
        assert!(names.iter().all(|name| name.len() <= MAX_GROUP_NAME && name.chars().all(legal)), "{names:?}");
    }
}
