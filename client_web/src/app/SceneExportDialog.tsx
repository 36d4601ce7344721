/** Export of the scene with its look: format, saved looks as variants, and what the file will not have. */
import { useEffect, useRef, useState } from "preact/hooks";
import { savedLooks } from "../panels/looks/savedLooks";
import { download } from "../panels/looks/renderJob";
import type { ExportReportBody, ExportRequest } from "../protocol";
import { EXPORT_FORMATS, exportFile, exportReport, reportLines } from "../session/scene/sceneExport";
import { look } from "../state/look";
import { scene } from "../state/scene";
import { IconButton } from "../ui/IconButton";
import { RadioRow } from "../ui/RadioRow";

const URL_LIFETIME_MS = 10_000;

/** The report of a request; null while it is computed, or its error. */
function useReport(id: string, request: ExportRequest): ExportReportBody | Error | null {
  const [report, setReport] = useState<ExportReportBody | Error | null>(null);
  const key = JSON.stringify(request);
  useEffect(() => {
    let isCurrent = true;
    setReport(null);
    exportReport(id, JSON.parse(key) as ExportRequest).then(
      (answer) => isCurrent && setReport(answer),
      (error: unknown) => isCurrent && setReport(error as Error),
    );
    return () => {
      isCurrent = false;
    };
  }, [id, key]);
  return report;
}

function ReportList({ report, isMix }: { report: ExportReportBody | Error | null; isMix: boolean }) {
  if (report === null) return <p role="status">{isMix ? "Reading lights…" : "Fitting materials…"}</p>;
  if (report instanceof Error) return <p role="alert">{report.message}</p>;
  const lines = reportLines(report);
  const complete = isMix
    ? "The file has all lights, without materials."
    : "The file has everything that the look shows.";
  if (lines.length === 0) return <p role="status">{complete}</p>;
  return (
    <ul role="status" aria-label="Differences">
      {lines.map((line) => (
        <li key={line}>{line}</li>
      ))}
    </ul>
  );
}

export function SceneExportDialog({ onClose }: { onClose: () => void }) {
  const dialog = useRef<HTMLDialogElement>(null);
  const [format, setFormat] = useState<NonNullable<ExportRequest["format"]>>("glb");
  const [hasVariants, setHasVariants] = useState(false);
  const [busy, setBusy] = useState(false);
  const [problem, setProblem] = useState("");
  const [exportedLook] = useState(() => look.peek());
  useEffect(() => dialog.current?.showModal(), []);
  const id = scene.value?.id ?? "";
  const isMix = format === "light_mix";
  const variants = hasVariants && !isMix ? savedLooks.value.map(({ name }) => name) : [];
  const request = { format, look: exportedLook ?? {}, variants } as ExportRequest;
  const report = useReport(id, request);
  const save = async () => {
    setBusy(true);
    setProblem("");
    try {
      const { blob, name } = await exportFile(id, request);
      const url = URL.createObjectURL(blob);
      download(url, name);
      window.setTimeout(() => URL.revokeObjectURL(url), URL_LIFETIME_MS);
      dialog.current?.close();
    } catch (error) {
      setProblem((error as Error).message);
    }
    setBusy(false);
  };
  return (
    <dialog
      class="export-dialog"
      ref={dialog}
      aria-label="Export scene"
      onClose={onClose}
      onKeyDown={(event) => event.stopPropagation()}
    >
      <header class="panel-head">
        <h2>Export scene</h2>
        <IconButton icon="close" label="Close" onClick={() => dialog.current?.close()} />
      </header>
      <RadioRow label="Format" choices={EXPORT_FORMATS} selected={format} onSelect={setFormat} />
      <label>
        <input
          type="checkbox"
          checked={hasVariants}
          disabled={isMix || savedLooks.value.length === 0}
          onChange={(event) => setHasVariants(event.currentTarget.checked)}
        />
        Saved looks as variants
      </label>
      <ReportList report={report} isMix={isMix} />
      {problem !== "" && <p role="alert">{problem}</p>}
      <button disabled={busy || report === null || report instanceof Error} onClick={() => void save()}>
        {busy ? "Exporting…" : "Download"}
      </button>
    </dialog>
  );
}
