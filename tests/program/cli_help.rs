//! The help texts are part of what users learn, so changes to them are seen: each is held in `tests/snapshots/`.
//!
//! After a change that is meant, `AO4D_BLESS=1 cargo test --test program cli_help` writes them anew.

use std::path::Path;
use std::process::Command;

#[test]
fn help_texts() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/snapshots");
    let bless = std::env::var_os("AO4D_BLESS").is_some();
    let verbs = [
        "",
        "run",
        "check",
        "study",
        "compare",
        "info",
        "devices",
        "schema",
        "page",
        "example",
        "completions",
        "man",
        "merge",
    ];
    for verb in verbs {
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

fn ao4d(arguments: &[&str]) -> (Option<i32>, String, String) {
    let mut command = Command::new(env!("CARGO_BIN_EXE_ao4d"));
    let output = command.args(arguments).env("NO_COLOR", "1").output().unwrap();
    let text = |bytes| String::from_utf8(bytes).unwrap();
    (output.status.code(), text(output.stdout), text(output.stderr))
}

#[test]
fn shells_and_manuals_know_every_verb_and_option() {
    let (_, help, _) = ao4d(&["help"]);
    let verbs: Vec<&str> =
        help.lines().skip_while(|l| *l != "Commands:").skip(1).map_while(|l| l.split_whitespace().next()).collect();
    assert!(verbs.contains(&"run") && verbs.contains(&"completions"), "{help}");
    for shell in ["bash", "elvish", "fish", "powershell", "zsh"] {
        let (code, text, told) = ao4d(&["completions", shell]);
        assert_eq!((code, told.as_str()), (Some(0), ""), "{shell}");
        verbs.iter().for_each(|verb| assert!(text.contains(verb), "{shell}: {verb}"));
        assert!(text.contains("tolerances"), "{shell}");
        // Names of examples, where scripts for the shell complete values.
        let values = ["bash", "zsh"].contains(&shell);
        assert_eq!(text.contains("lessons/02_cube"), values, "{shell}");
    }
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("man1");
    assert_eq!(ao4d(&["man", "--out", out.to_str().unwrap()]).0, Some(0));
    for verb in verbs.iter().filter(|verb| **verb != "help") {
        let page = std::fs::read_to_string(out.join(format!("ao4d-{verb}.1"))).unwrap();
        assert!(page.contains(&format!(".TH ao4d-{verb} 1")) && page.contains("\n.SH OPTIONS\n"), "{verb}: {page}");
        assert_eq!(ao4d(&["man", verb]).1, page);
    }
    assert!(std::fs::read_to_string(out.join("ao4d.1")).unwrap().contains("ao4d\\-run(1)"));
    let (code, _, told) = ao4d(&["man", "rum"]);
    assert!(code == Some(2) && told.contains("there is no command `rum` (known: run, merge, check"), "{told}");
}

#[test]
fn versions_are_short_or_long() {
    assert_eq!(ao4d(&["--version"]).1, format!("ao4d {}\n", env!("CARGO_PKG_VERSION")));
    let (code, text, _) = ao4d(&["--version", "-v"]);
    assert_eq!(code, Some(0));
    for word in ["ao4d ", "commit ", "built for ", "processor ", "opencl ", "paraview "] {
        assert!(text.lines().any(|line| line.starts_with(word)), "{word}: {text}");
    }
    assert_eq!(ao4d(&["-vV"]).1, text);
}

#[test]
fn examples_are_written_with_what_they_read() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().to_str().unwrap();
    let (code, list, _) = ao4d(&["example"]);
    assert_eq!(code, Some(0));
    assert!(list.lines().count() > 25 && list.contains("lessons/02_cube"), "{list}");
    assert_eq!(ao4d(&["example", "08-ant", "--out", out]).0, Some(0), "the end of a name, with a dash");
    let path = folder.path().join("lessons/08_ant.yaml");
    let text = std::fs::read_to_string(&path).unwrap();
    assert!(text.starts_with("# yaml-language-server: $schema=../ao4d.schema.json\n"), "{text}");
    assert!(
        folder.path().join("ao4d.schema.json").is_file() && folder.path().join("meshes/LICENSE-pyvista.txt").is_file()
    );
    assert!(!folder.path().join("data").exists());
    let (code, _, told) = ao4d(&["check", path.to_str().unwrap()]);
    assert_eq!(code, Some(0), "{told}");
    // Again is no fault, but what was edited stays.
    assert_eq!(ao4d(&["example", "lessons/08_ant", "--out", out]).0, Some(0));
    std::fs::write(&path, text.clone() + "# mine\n").unwrap();
    let (code, _, told) = ao4d(&["example", "lessons/08_ant", "--out", out]);
    assert!(code == Some(2) && told.contains("08_ant.yaml is there already; write elsewhere by --out"), "{told}");
    assert_eq!(ao4d(&["example", "lessons/08_ant", "--out", out, "--force"]).0, Some(0));
    assert_eq!(std::fs::read_to_string(&path).unwrap(), text);
    let (code, _, told) = ao4d(&["example", "two_tetraedra", "--out", out]);
    assert!(code == Some(2) && told.contains("did you mean `two_tetrahedra`?"), "{told}");
}
