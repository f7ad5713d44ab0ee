//! Tells the program which commit it is built from, for `ao4d --version -v`: of a checkout what `git` says, of a package what
//! stands in it. Builds for development don't ask, since each commit would compile everything again.

use std::path::Path;
use std::process::Command;

/// What `cargo package` writes into a package.
const PACKAGED: &str = ".cargo_vcs_info.json";

fn main() {
    println!("cargo:rerun-if-changed=build.rs");
    // A file that isn't there counts as changed, and everything would be compiled again and again.
    if Path::new(PACKAGED).exists() {
        println!("cargo:rerun-if-changed={PACKAGED}");
    }
    let commit =
        packaged().or_else(|| if std::env::var("PROFILE").as_deref() == Ok("release") { checked_out() } else { None });
    if let Some(commit) = commit {
        println!("cargo:rustc-env=AO4D_COMMIT={commit}");
    }
}

/// The commit that `cargo package` wrote down.
fn packaged() -> Option<String> {
    let text = std::fs::read_to_string(PACKAGED).ok()?;
    let after = text.split("\"sha1\"").nth(1)?;
    let hash = after.split('"').nth(1)?;
    hash.chars().all(|c| c.is_ascii_hexdigit()).then(|| hash.chars().take(12).collect())
}

/// The commit that is checked out here.
fn checked_out() -> Option<String> {
    let git = |arguments: &[&str]| {
        let output = Command::new("git").args(arguments).output().ok().filter(|output| output.status.success())?;
        Some(String::from_utf8(output.stdout).ok()?.trim().to_owned()).filter(|text| !text.is_empty())
    };
    // Another repository may lie around this folder.
    let top = git(&["rev-parse", "--show-toplevel"])?;
    let here = std::env::current_dir().ok()?.canonicalize().ok()?;
    if Path::new(&top).canonicalize().ok()? != here {
        return None;
    }
    for name in ["HEAD", "index"] {
        if let Some(path) = git(&["rev-parse", "--git-path", name]) {
            println!("cargo:rerun-if-changed={path}");
        }
    }
    let changed =
        git(&["--no-optional-locks", "status", "--porcelain", "--untracked-files=no"]).map_or("", |_| " with changes");
    Some(git(&["rev-parse", "--short=12", "HEAD"])? + changed)
}
