//! One piece of work: a scene, the result of it, and beside the scene the studio's folder.

use std::path::PathBuf;

use sha2::{Digest, Sha256};
use tessuto::io::atomic_write;

use super::form::Form;
use super::place::{LONGEST_NEW, Project};

/// Where results go.
const RESULTS: &str = "results";
/// Where the scenes of clips go.
pub const SCENES: &str = "scenes";
/// End of the name of the studio's folder.
const BESIDE: &str = ".studio";
/// Most bytes of a form.
const LONGEST_FORM: u64 = 1 << 20;

/// Names of the parts, of which some may not exist yet.
pub struct Work<'a> {
    /// Where the names lead.
    pub project: &'a Project,
    name: String,
}

impl<'a> Work<'a> {
    /// The work called `name`, a scene or, where there is none any more, its result; `None` if the name is none, or too
    /// long for what is made beside it.
    pub fn new(project: &'a Project, name: &str) -> Option<Self> {
        let short = name.split('/').all(|part| part.len() <= LONGEST_NEW);
        project.place(name).filter(|_| short).map(|_| Self { project, name: name.to_owned() })
    }

    /// Name of the scene folder.
    pub fn scene(&self) -> &str {
        &self.name
    }

    /// Name of the result folder.
    pub fn result(&self) -> String {
        if self.is_result() {
            return self.name.clone();
        }
        let last = self.name.rsplit('/').next().expect("a name has a part");
        format!("{RESULTS}/{last}")
    }

    /// Whether the work is a result without its scene.
    pub fn is_result(&self) -> bool {
        self.has(&format!("{}/motion.npy", self.name))
    }

    /// Name of `part` of the studio's folder.
    pub fn beside(&self, part: &str) -> String {
        format!("{}{BESIDE}/{part}", self.name)
    }

    /// Whether there is something of this name.
    pub fn has(&self, name: &str) -> bool {
        self.project.find(name).is_some()
    }

    /// The file of this name as JSON, if it is one.
    pub fn json(&self, name: &str) -> Option<serde_json::Value> {
        serde_json::from_str(&tessuto::io::read_text(&self.project.find(name)?).ok()?).ok()
    }

    /// What was entered before; nothing if that cannot be read.
    pub fn form(&self) -> Form {
        let file = self.project.find(&self.beside("form.json"));
        let file = file.filter(|f| f.metadata().is_ok_and(|m| m.len() < LONGEST_FORM));
        let text = file.and_then(|file| std::fs::read(file).ok());
        text.and_then(|text| serde_json::from_slice(&text).ok()).unwrap_or_default()
    }

    /// Changes with what was entered.
    pub fn form_version(&self) -> String {
        let file = self.project.find(&self.beside("form.json"));
        let text = file.and_then(|file| std::fs::read(file).ok()).unwrap_or_default();
        Sha256::digest(text)[..8].iter().map(|byte| format!("{byte:02x}")).collect()
    }

    /// Keeps what was entered.
    ///
    /// # Errors
    /// A sentence for the user.
    pub fn save(&self, form: &Form) -> Result<(), String> {
        form.check()?;
        let mut text = serde_json::to_string_pretty(form).expect("plain data");
        text.push('\n');
        let path = self.folder("form.json")?;
        atomic_write(&path, text.as_bytes()).map_err(|e| e.to_string())
    }

    /// Where `part` of the studio's folder is to be written; makes the folder.
    ///
    /// # Errors
    /// A sentence for the user.
    pub fn folder(&self, part: &str) -> Result<PathBuf, String> {
        let name = self.beside(part);
        let path = self.project.place(&name).ok_or_else(|| format!("{name} leads out of the project"))?;
        let parent = path.parent().expect("it has two parts");
        std::fs::create_dir_all(parent).map_err(|e| format!("cannot write {}: {e}", parent.display()))?;
        Ok(path)
    }
}
