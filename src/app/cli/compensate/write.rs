use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};

use super::{CompensateArgs, CompensateCommandError, WriteCause};
use crate::compensation::{Corrected, Refused};
use crate::io::table::{self, Table};
use crate::io::targets::{self, Form, JointUnits, Targets};
use crate::io::whole_file::write_whole;

pub(super) struct Written<'a> {
    pub(super) result: &'a Table,
    pub(super) targets: &'a Targets,
    pub(super) outcomes: &'a [Result<Corrected, Refused>],
    pub(super) table_id: &'a str,
    pub(super) units: JointUnits,
}

/// Path of the file next to a data list that holds, for each target, the columns that the list cannot.
pub(super) fn sidecar(out: &Path) -> PathBuf {
    let mut name = out.as_os_str().to_owned();
    name.push(".corrections.csv");
    PathBuf::from(name)
}

impl CompensateArgs {
    /// The form of the result, known before anything is read.
    pub(super) fn out_form(&self) -> Result<Form, CompensateCommandError> {
        self.check_folders()?;
        let form = Form::of(&self.targets)?;
        let Some(out) = &self.out else {
            return Ok(if form == Form::Json { form } else { Form::Csv });
        };
        let wanted = Form::of(out)?;
        if wanted == Form::Krl && form != Form::Krl {
            return Err(CompensateCommandError::OnlyFromKrl {
                out: out.clone(),
                targets: self.targets.clone(),
            });
        }
        let beside = (wanted == Form::Krl).then(|| sidecar(out));
        let all = [out.clone()].into_iter().chain(beside);
        let taken = all.into_iter().find(|path| path.exists());
        taken.map_or(Ok(wanted), |path| Err(CompensateCommandError::Exists(path)))
    }

    pub(super) fn write(
        &self,
        written: &Written<'_>,
        bytes: &[u8],
        form: Form,
        mut stdout: impl Write,
    ) -> Result<(), CompensateCommandError> {
        let failed = |path: Option<&Path>| {
            let path = path.map(Path::to_owned);
            move |source: WriteCause| CompensateCommandError::Write { path, source }
        };
        let Some(out) = &self.out else {
            let done = stdout.write_all(bytes).and_then(|()| stdout.flush());
            return done.map_err(|source| failed(None)(source.into()));
        };
        let whole = || write_whole(out, |sink| Ok(sink.write_all(bytes)?));
        if form != Form::Krl {
            return whole().map_err(failed(Some(out)));
        }
        // The list is written last: where it exists, its corrections do too.
        let beside = sidecar(out);
        write_whole(&beside, |sink| written.form(Form::Csv, sink))
            .map_err(failed(Some(&beside)))?;
        whole().map_err(|cause| {
            // The first error is the one to report.
            let _ = fs::remove_file(&beside);
            failed(Some(out))(cause)
        })
    }

    pub(super) fn not_written(&self, source: WriteCause) -> CompensateCommandError {
        let path = self.out.clone();
        CompensateCommandError::Write { path, source }
    }
}

impl Written<'_> {
    pub(super) fn bytes(&self, form: Form) -> Result<Vec<u8>, WriteCause> {
        if let (Form::Krl, Some(list)) = (form, &self.targets.list) {
            return Ok(list.write(self.outcomes, self.table_id));
        }
        let mut bytes = Vec::new();
        self.form(form, &mut bytes)?;
        Ok(bytes)
    }

    fn form(&self, form: Form, mut sink: impl Write) -> Result<(), WriteCause> {
        match form {
            Form::Csv | Form::Krl => Ok(targets::write_csv(self.result, self.units.clone(), sink)?),
            Form::Json => Ok(targets::write_json(self.result, self.units.clone(), sink)?),
            Form::Parquet => {
                let bytes = table::write(self.result, Vec::new())?;
                Ok(sink.write_all(&bytes)?)
            }
        }
    }
}
