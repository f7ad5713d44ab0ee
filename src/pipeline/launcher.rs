//! Which piece of a run a process is to make, as whoever launched it says in its environment.
//!
//! `mpirun`, `srun` and Slurm's job arrays tell each process its number and how many there are; nothing has to be linked for
//! that. The launcher nearest to the process counts: `mpirun` before the job that it runs in. One that launched a single
//! process says nothing, so that `mpirun -n 1`, a job of one task and a plain call all make the whole.
//!
//! A Slurm batch script is itself task 0 of its job, though nobody asked for several processes yet: there only `srun` does.

use crate::stages::Piece;

/// What the environment says.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Launched {
    /// The piece; none for the whole run.
    pub piece: Option<Piece>,
    /// What is worth telling the user of it.
    pub note: Option<String>,
}

/// The remedy that every complaint ends with.
const REMEDY: &str = "say --piece K/N, or --piece none for the whole run";
/// Numbers of steps from here on mean no step of `srun`, but the batch script or a shell in the job.
const NO_STEP: u64 = 0xffff_fff0;

impl Launched {
    /// What an environment says, whose variables `get` knows.
    ///
    /// # Errors
    /// If it contradicts itself, or says too little.
    pub fn from_environment(get: impl Fn(&str) -> Option<String>) -> Result<Self, String> {
        let number = |name: &str| match get(name).map(|text| text.trim().to_owned()).filter(|text| !text.is_empty()) {
            None => Ok(None),
            Some(text) => match text.parse::<u64>() {
                Ok(number) => Ok(Some(number)),
                Err(_) => {
                    Err(format!("{name} is \"{}\", which is no number; {REMEDY}", crate::text::shortened(&text, 40)))
                }
            },
        };
        for (rank, size) in [("OMPI_COMM_WORLD_RANK", "OMPI_COMM_WORLD_SIZE"), ("PMI_RANK", "PMI_SIZE")] {
            if let (Some(k), Some(n)) = (number(rank)?, number(size)?)
                && n > 1
            {
                return Self::piece(k, n, &format!("{rank} and {size}"));
            }
        }
        let step = number("SLURM_STEP_ID")?.filter(|&step| step < NO_STEP);
        let in_step = step.is_some() || number("SLURM_STEP_NUM_TASKS")?.is_some_and(|n| n > 1);
        let in_job = number("SLURM_JOB_ID")?.is_some();
        let tasks = match number("SLURM_STEP_NUM_TASKS")?.filter(|_| in_step) {
            Some(tasks) => Some(tasks),
            None => number("SLURM_NTASKS")?,
        };
        let known = |name: &str| get(name).is_some();
        if let Some(k) = number("PMIX_RANK")?
            && !known("OMPI_COMM_WORLD_SIZE")
            && !known("PMI_SIZE")
        {
            match tasks {
                Some(1) => {}
                // A program that has called MPI for itself alone leaves this to those it starts, as ParaView's do.
                None if k == 0 => {}
                Some(n) => return Self::piece(k, n, "PMIX_RANK and Slurm's number of tasks"),
                None => {
                    return Err(format!(
                        "PMIX_RANK says that this is process {k}, and nothing says of how many; {REMEDY}"
                    ));
                }
            }
        }
        let mut note = None;
        if let (Some(k), Some(n)) = (number("SLURM_PROCID")?, tasks)
            && n > 1
        {
            if in_step || !in_job || k > 0 {
                return Self::piece(k, n, "SLURM_PROCID and the number of tasks");
            }
            note = Some(format!(
                "this is the script of a Slurm job of {n} tasks, not one of them, so it makes the whole run; `srun ao4d run` makes \
                 a piece in each task, and --piece none silences this"
            ));
        }
        if let Some(id) = number("SLURM_ARRAY_TASK_ID")? {
            let count = number("SLURM_ARRAY_TASK_COUNT")?;
            let (least, most) = (number("SLURM_ARRAY_TASK_MIN")?.unwrap_or(0), number("SLURM_ARRAY_TASK_MAX")?);
            let step = number("SLURM_ARRAY_TASK_STEP")?.unwrap_or(1).max(1);
            let Some(count) = count else {
                return Err(format!(
                    "SLURM_ARRAY_TASK_ID says that this is task {id}, and SLURM_ARRAY_TASK_COUNT is not there to say of how \
                     many; {REMEDY}"
                ));
            };
            if count > 1 {
                let even = most.is_none_or(|most| most.checked_sub(least).is_some_and(|d| d / step + 1 == count));
                let k = id.checked_sub(least).filter(|d| even && d % step == 0).map(|d| d / step);
                let Some(k) = k else {
                    return Err(format!(
                        "the tasks of this Slurm array are not evenly spaced, so nothing says which of the {count} task {id} \
                         is; {REMEDY}"
                    ));
                };
                return Self::piece(k, count, "SLURM_ARRAY_TASK_ID and the array's range");
            }
            if id > 0 {
                return Err(format!(
                    "this is task {id} of a Slurm array of one task, as when a single task is submitted again, and nothing \
                     says of how many pieces it makes one; {REMEDY}"
                ));
            }
        }
        Ok(Self { piece: None, note })
    }

    fn piece(k: u64, n: u64, by: &str) -> Result<Self, String> {
        let number = |x: u64| usize::try_from(x).unwrap_or(usize::MAX);
        let piece = Piece::new(number(k), number(n)).map_err(|error| format!("{by}: {error}; {REMEDY}"))?;
        let note = format!("piece {piece}, by {by}; --piece none makes the whole run");
        Ok(Self { piece: Some(piece), note: Some(note) })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What an environment says, in short: the piece, `whole`, or the complaint.
    fn said(variables: &[(&str, &str)]) -> String {
        let get = |name: &str| variables.iter().find(|(own, _)| *own == name).map(|(_, value)| (*value).to_owned());
        match Launched::from_environment(get) {
            Ok(Launched { piece: Some(piece), .. }) => piece.to_string(),
            Ok(Launched { note: Some(note), .. }) => note,
            Ok(_) => "whole".to_owned(),
            Err(error) => error,
        }
    }

    #[test]
    fn launchers_tell_pieces() {
        for (variables, expected) in [
            (&[][..], "whole"),
            (&[("OMPI_COMM_WORLD_RANK", "2"), ("OMPI_COMM_WORLD_SIZE", "4"), ("PMIX_RANK", "2")], "2/4"),
            (&[("OMPI_COMM_WORLD_RANK", "0"), ("OMPI_COMM_WORLD_SIZE", "1"), ("PMIX_RANK", "0")], "whole"),
            (&[("PMI_RANK", "3"), ("PMI_SIZE", "8")], "3/8"),
            (&[("PMI_RANK", "0"), ("PMI_SIZE", "1"), ("PMIX_RANK", "0")], "whole"),
            // srun.
            (
                &[
                    ("SLURM_JOB_ID", "9"),
                    ("SLURM_STEP_ID", "0"),
                    ("SLURM_PROCID", "0"),
                    ("SLURM_NTASKS", "4"),
                    ("SLURM_STEP_NUM_TASKS", "4"),
                ],
                "0/4",
            ),
            (
                &[
                    ("SLURM_JOB_ID", "9"),
                    ("SLURM_STEP_ID", "1"),
                    ("SLURM_PROCID", "3"),
                    ("SLURM_NTASKS", "8"),
                    ("SLURM_STEP_NUM_TASKS", "4"),
                    ("PMIX_RANK", "3"),
                ],
                "3/4",
            ),
            (
                &[
                    ("SLURM_JOB_ID", "9"),
                    ("SLURM_STEP_ID", "0"),
                    ("SLURM_PROCID", "0"),
                    ("SLURM_NTASKS", "8"),
                    ("SLURM_STEP_NUM_TASKS", "1"),
                ],
                "whole",
            ),
            (&[("SLURM_PROCID", "1"), ("SLURM_NTASKS", "4")], "1/4"),
            (&[("SLURM_PROCID", "0"), ("SLURM_NTASKS", "4")], "0/4"),
            // A batch script of one task, and mpirun in one of several.
            (&[("SLURM_JOB_ID", "9"), ("SLURM_PROCID", "0"), ("SLURM_NTASKS", "1")], "whole"),
            (
                &[
                    ("SLURM_JOB_ID", "9"),
                    ("SLURM_PROCID", "0"),
                    ("SLURM_NTASKS", "8"),
                    ("OMPI_COMM_WORLD_RANK", "5"),
                    ("OMPI_COMM_WORLD_SIZE", "8"),
                ],
                "5/8",
            ),
            // A program that has initialised MPI by itself.
            (&[("PMIX_RANK", "0"), ("PMIX_NAMESPACE", "1")], "whole"),
            // Arrays.
            (
                &[
                    ("SLURM_JOB_ID", "9"),
                    ("SLURM_PROCID", "0"),
                    ("SLURM_NTASKS", "1"),
                    ("SLURM_ARRAY_TASK_ID", "3"),
                    ("SLURM_ARRAY_TASK_COUNT", "4"),
                    ("SLURM_ARRAY_TASK_MIN", "0"),
                    ("SLURM_ARRAY_TASK_MAX", "3"),
                    ("SLURM_ARRAY_TASK_STEP", "1"),
                ],
                "3/4",
            ),
            (
                &[
                    ("SLURM_ARRAY_TASK_ID", "17"),
                    ("SLURM_ARRAY_TASK_COUNT", "3"),
                    ("SLURM_ARRAY_TASK_MIN", "7"),
                    ("SLURM_ARRAY_TASK_MAX", "17"),
                    ("SLURM_ARRAY_TASK_STEP", "5"),
                ],
                "2/3",
            ),
            (&[("SLURM_ARRAY_TASK_ID", "0"), ("SLURM_ARRAY_TASK_COUNT", "1"), ("SLURM_ARRAY_TASK_MIN", "0")], "whole"),
            // mpirun in each task of an array: the nearer one counts.
            (
                &[
                    ("SLURM_ARRAY_TASK_ID", "1"),
                    ("SLURM_ARRAY_TASK_COUNT", "4"),
                    ("OMPI_COMM_WORLD_RANK", "1"),
                    ("OMPI_COMM_WORLD_SIZE", "2"),
                ],
                "1/2",
            ),
            (
                &[
                    ("SLURM_ARRAY_TASK_ID", "1"),
                    ("SLURM_ARRAY_TASK_COUNT", "4"),
                    ("OMPI_COMM_WORLD_RANK", "0"),
                    ("OMPI_COMM_WORLD_SIZE", "1"),
                ],
                "1/4",
            ),
        ] {
            assert_eq!(said(variables), expected, "{variables:?}");
        }
    }

    #[test]
    fn a_batch_script_is_no_piece_and_says_so() {
        let script = [("SLURM_JOB_ID", "9"), ("SLURM_PROCID", "0"), ("SLURM_NTASKS", "8")];
        assert!(said(&script).contains("so it makes the whole run"), "{}", said(&script));
        let shell = [("SLURM_STEP_ID", "4294967290"), script[0], script[1], script[2]];
        assert!(said(&shell).contains("so it makes the whole run"), "{}", said(&shell));
    }

    #[test]
    fn what_says_too_little_or_the_impossible_is_refused() {
        for (variables, expected) in [
            (&[("OMPI_COMM_WORLD_RANK", "x"), ("OMPI_COMM_WORLD_SIZE", "4")][..], "which is no number"),
            (&[("OMPI_COMM_WORLD_RANK", "-1"), ("OMPI_COMM_WORLD_SIZE", "4")], "which is no number"),
            (&[("PMI_RANK", "4"), ("PMI_SIZE", "4")], "there is no piece 4 of 4"),
            (&[("PMIX_RANK", "1")], "nothing says of how many"),
            (&[("SLURM_ARRAY_TASK_ID", "1")], "is not there to say of how many"),
            (
                &[
                    ("SLURM_ARRAY_TASK_ID", "7"),
                    ("SLURM_ARRAY_TASK_COUNT", "3"),
                    ("SLURM_ARRAY_TASK_MIN", "1"),
                    ("SLURM_ARRAY_TASK_MAX", "7"),
                ],
                "not evenly spaced",
            ),
            (
                &[("SLURM_ARRAY_TASK_ID", "3"), ("SLURM_ARRAY_TASK_COUNT", "1"), ("SLURM_ARRAY_TASK_MIN", "3")],
                "a single task is submitted again",
            ),
        ] {
            assert!(said(variables).contains(expected), "{variables:?}: {}", said(variables));
            assert!(said(variables).ends_with(REMEDY), "{variables:?}");
        }
    }
}
