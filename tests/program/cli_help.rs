//! The help texts are part of what users learn, so changes to them are seen: each is held in `tests/snapshots/`.
//!
//! After a change that is meant, `AO4D_BLESS=1 cargo test --test program cli_help` writes them anew.

use std::path::Path;
use std::process::Command;

#[test]
fn help_texts() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/snapshots");
    let bless = std::env::var_os("AO4D_BLESS").is_some();
    for verb in ["", "run", "check", "study", "compare", "info", "devices", "schema", "merge"] {
        let mut command = Command::new(env!("CARGO_BIN_EXE_ao4d"));
        command.args(Some(verb).filter(|v| !v.is_empty())).arg("--help").env("COLUMNS", "100");
        let output = command.output().unwrap();
        assert_eq!(output.status.code(), Some(0), "{verb}");
        // Windows calls the program `ao4d.exe`.
        let help = String::from_utf8(output.stdout).unwrap().replace("ao4d.exe", "ao4d");
        let file = folder.join(if verb.is_empty() { "help.txt".into() } else { format!("help_{verb}.txt") });
        if bless {
            std::fs::write(&file, &help).unwrap();
        }
        let held = std::fs::read_to_string(&file).unwrap_or_default();
        assert_eq!(help, held, "`ao4d {verb} --help` changed; if that is meant, run with AO4D_BLESS=1");
    }
}
