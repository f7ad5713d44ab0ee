//! The program as its users see it: what it prints, leaves and refuses.

mod cli_errors;
mod cli_help;
mod cli_random;
mod cli_run;
mod cli_schema;
mod documents;
mod hostile;
mod inspect;
mod page;
mod reference;
mod study;
