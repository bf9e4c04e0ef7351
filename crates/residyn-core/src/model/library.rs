use std::path::Path;
use std::sync::{Arc, LazyLock, OnceLock};

use include_dir::{Dir, include_dir};

use super::effect::Effect;
use super::error::ModelError;
use super::reader::FileError;
use super::ready_drive::ReadyDrive;
use super::system::Model;

static BUILT_IN: Dir<'_> = include_dir!("$CARGO_MANIFEST_DIR/../../models");

/// Read once: every command and every library call asks for it.
static EMBEDDED: LazyLock<Library> = LazyLock::new(|| {
    Library::of(
        embedded("effects", Effect::from_text).into(),
        embedded("probes", Effect::from_text).into(),
    )
});

/// The effects and systems known by name: the embedded ones and a user's own. A clone shares them.
///
/// ```
/// use residyn_core::model::{Effect, Library};
///
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// let eddy_brake: Effect = r#"
///     [effect]
///     name = "eddy_brake"
///     about = "brake that loses its grip at speed"
///     force = "-b*qd/(1 + (qd/v_0)^2)"
///     [parameters]
///     b = { unit = "N m s/rad", about = "torque per speed at low speed", typical = 0.1, positive = true }
///     v_0 = { unit = "rad/s", about = "speed of the largest torque", typical = 5.0, positive = true }
/// "#
/// .parse()?;
/// let library = Library::built_in().with_effect(eddy_brake);
/// assert_eq!(library.effect("eddy_brake")?.parameters.len(), 2);
/// # Ok(())
/// # }
/// ```
#[derive(Debug, Clone)]
pub struct Library {
    effects: Arc<[Effect]>,
    probes: Arc<[Effect]>,
    /// Made on first use.
    of_one_filter: Arc<OnceLock<Vec<Library>>>,
    without_limits: Arc<OnceLock<Box<Library>>>,
    without_gains: Arc<OnceLock<Box<Library>>>,
}

impl Library {
    /// The embedded effects and systems.
    ///
    /// # Panics
    /// Never: a test reads every embedded file.
    pub fn built_in() -> Self {
        EMBEDDED.clone()
    }

    /// A library without effects and probes, in which nothing can be found.
    pub fn empty() -> Self {
        Self::of(Arc::default(), Arc::default())
    }

    fn of(effects: Arc<[Effect]>, probes: Arc<[Effect]>) -> Self {
        Self {
            effects,
            probes,
            of_one_filter: Arc::default(),
            without_limits: Arc::default(),
            without_gains: Arc::default(),
        }
    }

    /// Add an effect; it replaces a known one of the same name.
    #[must_use]
    pub fn with_effect(self, effect: Effect) -> Self {
        let known = self.effects.iter();
        let mut effects: Vec<Effect> = known
            .filter(|known| known.name != effect.name)
            .cloned()
            .collect();
        let place = effects.partition_point(|known| known.name < effect.name);
        effects.insert(place, effect);
        Self::of(effects.into(), self.probes)
    }

    /// All effects, by name.
    pub fn effects(&self) -> &[Effect] {
        &self.effects
    }

    /// Generic functions of one variable without a physical name. They are fitted to the residual, to test whether it
    /// depends on that variable.
    pub fn probes(&self) -> &[Effect] {
        &self.probes
    }

    /// The library once for each filter of commands, without the others.
    pub(crate) fn of_one_filter(&self) -> &[Self] {
        let with_one = |one: &Effect| {
            let is_other = |effect: &Effect| effect.is_filter() && effect.name != one.name;
            self.with_those(|effect| !is_other(effect))
        };
        let filters = self.effects.iter().filter(|effect| effect.is_filter());
        self.of_one_filter
            .get_or_init(|| filters.map(with_one).collect())
    }

    /// The library without limits of drives' torques.
    pub(crate) fn without_limits(&self) -> &Self {
        self.without_limits
            .get_or_init(|| self.with_those(|effect| !effect.limits_command()).into())
    }

    /// The library without gains of drives.
    pub(crate) fn without_gains(&self) -> &Self {
        self.without_gains
            .get_or_init(|| self.with_those(|effect| !effect.is_gain()).into())
    }

    /// The library with some of its effects.
    fn with_those(&self, are_kept: impl Fn(&Effect) -> bool) -> Self {
        let kept = self.effects.iter().filter(|effect| are_kept(effect));
        Self::of(kept.cloned().collect(), self.probes.clone())
    }

    /// The effect of this name.
    ///
    /// # Errors
    /// Unknown name, with the nearest known one.
    pub fn effect(&self, name: &str) -> Result<&Effect, ModelError> {
        Effect::find(&self.effects, name)
    }

    /// The embedded drives, by name.
    ///
    /// # Panics
    /// Never: a test reads every embedded file.
    pub fn drives() -> Vec<ReadyDrive> {
        embedded("drives", ReadyDrive::from_text)
    }

    /// Names of the embedded systems.
    pub fn system_names() -> Vec<String> {
        let mut names: Vec<String> = BUILT_IN
            .files()
            .filter(|file| is_toml(file.path()))
            .filter_map(|file| Some(file.path().file_stem()?.to_str()?.to_owned()))
            .collect();
        names.sort();
        names
    }

    /// The text of an embedded system.
    pub fn system_text(name: &str) -> Option<&'static str> {
        BUILT_IN.get_file(format!("{name}.toml"))?.contents_utf8()
    }

    /// The system in the text of a model file; `name` is for messages.
    ///
    /// # Errors
    /// As [`Model::from_text`].
    pub fn model_from_text(&self, name: &str, text: &str) -> Result<Model, FileError> {
        Model::from_text(name.as_ref(), text, &self.effects)
    }

    /// The embedded system of this name.
    ///
    /// # Errors
    /// Unknown name, with the names of all embedded systems.
    pub fn model(&self, name: &str) -> Result<Model, FileError> {
        match Self::system_text(name) {
            Some(text) => self.model_from_text(name, text),
            None => {
                let known = Self::system_names().join(", ");
                let message = format!("no built-in system has this name; give one of {known}");
                Err(FileError::new(name.as_ref(), None, message))
            }
        }
    }
}

/// The embedded files of one folder, by name.
fn embedded<T>(folder: &str, read: impl Fn(&Path, &str) -> Result<T, FileError>) -> Vec<T> {
    let files = BUILT_IN
        .get_dir(folder)
        .expect("the folder is embedded")
        .files();
    let mut files: Vec<_> = files.filter(|file| is_toml(file.path())).collect();
    files.sort_by_key(|file| file.path());
    let whole = files.into_iter().map(|file| {
        let text = file.contents_utf8().expect("embedded files are UTF-8");
        read(file.path(), text).expect("embedded files are read by a test")
    });
    whole.collect()
}

fn is_toml(path: &Path) -> bool {
    path.extension() == Some("toml".as_ref())
}

#[cfg(test)]
mod tests {
    use super::Library;

    const WEAK: &str = r#"
        [effect]
        name = "NAME"
        about = "a weak spring"
        force = "-k*q"
        [parameters]
        k = { unit = "N m/rad", about = "stiffness", typical = 0.01 }
    "#;

    #[test]
    fn an_effect_from_text_joins_the_library_or_replaces_its_namesake() {
        let known = Library::built_in();
        let new = |name: &str| WEAK.replace("NAME", name).parse().unwrap();
        let more = known.clone().with_effect(new("weak_spring"));
        assert_eq!(more.effects().len(), known.effects().len() + 1);
        assert!(more.effects().is_sorted_by_key(|effect| &effect.name));
        assert!(known.effect("weak_spring").is_err());
        let other = known.clone().with_effect(new("joint_spring"));
        assert_eq!(other.effects().len(), known.effects().len());
        assert_eq!(other.effect("joint_spring").unwrap().about, "a weak spring");
    }

    #[test]
    fn the_embedded_effects_are_read_once() {
        let [first, second] = [Library::built_in(), Library::built_in()];
        assert!(std::ptr::eq(first.effects(), second.effects()));
    }

    #[test]
    fn a_library_of_one_filter_has_all_other_effects() {
        let whole = Library::built_in();
        let filters = whole.effects().iter().filter(|effect| effect.is_filter());
        let names: Vec<&String> = filters.map(|filter| &filter.name).collect();
        assert_eq!(names, ["actuator_delay", "actuator_lag"]);
        for (name, alone) in names.into_iter().zip(whole.of_one_filter()) {
            assert_eq!(alone.effects().len(), whole.effects().len() - 1);
            assert!(alone.effect(name).is_ok());
        }
    }

    #[test]
    fn a_library_without_limits_has_all_other_effects() {
        let whole = Library::built_in();
        let without = whole.without_limits();
        assert_eq!(without.effects().len(), whole.effects().len() - 2);
        assert!(without.effect("actuator_saturation").is_err());
        assert!(without.effect("actuator_gain").is_ok());
    }

    #[test]
    fn a_library_without_gains_has_all_other_effects() {
        let whole = Library::built_in();
        let without = whole.without_gains();
        assert_eq!(without.effects().len(), whole.effects().len() - 1);
        assert!(without.effect("actuator_gain").is_err());
    }

    #[test]
    fn every_embedded_file_is_valid() {
        let library = Library::built_in();
        assert!(library.effects().len() >= 13);
        for name in Library::system_names() {
            library.model(&name).unwrap();
        }
        assert!(Library::drives().len() >= 4);
        for effect in library.effects() {
            for other in effect.contains.iter().chain(&effect.confused_with) {
                let of_system = other == "parameter_shift";
                assert!(
                    of_system || library.effect(other).is_ok(),
                    "{} names {other}",
                    effect.name
                );
            }
        }
    }
}
