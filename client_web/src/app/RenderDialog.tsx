/** Renders looks in views as one batch: names, size, format and cost before, progress meanwhile. */
import { useEffect, useId, useRef, useState } from "preact/hooks";
import {
  batchFile,
  batchRequest,
  choiceProblem,
  namesText,
  size4K,
  type BatchChoice,
  type BatchFormat,
} from "../panels/looks/batchRequest";
import { currentPose, currentSize } from "../panels/looks/exportImage";
import { exporting, exportText, renderAndSave } from "../panels/looks/renderJob";
import { savedLooks } from "../panels/looks/savedLooks";
import type { RenderPlanBody, RenderRequest } from "../protocol";
import { planRender } from "../session/net/api";
import { PlanText } from "../start/PlanText";
import { bake } from "../state/bakes";
import { availableExrSpace } from "../state/color";
import { look } from "../state/look";
import { activeView, activeViewName, views } from "../state/views";
import { lightFilterText } from "../state/visibility/activeFilters";
import { visibleLookOf } from "../state/visibility/displayState";
import { IconButton } from "../ui/IconButton";
import { RadioRow } from "../ui/RadioRow";

const TYPING_DELAY_MS = 300;
const FORMATS: { value: BatchFormat; label: string; title: string }[] = [
  { value: "png", label: "PNG", title: "As displayed, 8 bits" },
  { value: "webp", label: "WebP", title: "As displayed, smaller" },
  { value: "exr", label: "EXR", title: "Linear radiance" },
  { value: "exr_layers", label: "EXR layers", title: "Beauty plus one layer per light and per light path" },
];
const PRIORITIES = [
  { value: "-5", label: "Low", title: "After your other renders" },
  { value: "0", label: "Normal", title: "In the order of your renders" },
  { value: "5", label: "High", title: "Before your other renders" },
];
type SizeKind = "baked" | "4k" | "custom";

/** Names and cost of a request; null while they are computed, or the error. */
function useRenderPlan(request: RenderRequest | null): RenderPlanBody | Error | null {
  const [plan, setPlan] = useState<RenderPlanBody | Error | null>(null);
  const key = JSON.stringify(request);
  useEffect(() => {
    let isCurrent = true;
    setPlan(null);
    if (key === "null") return undefined;
    const timer = setTimeout(() => {
      planRender(JSON.parse(key) as RenderRequest).then(
        (answer) => isCurrent && setPlan(answer),
        (error: unknown) => isCurrent && setPlan(error as Error),
      );
    }, TYPING_DELAY_MS);
    return () => {
      isCurrent = false;
      clearTimeout(timer);
    };
  }, [key]);
  return plan;
}

interface CheckListProps {
  legend: string;
  items: readonly string[];
  selected: readonly string[];
  isDisabled?: boolean;
  onChange: (selected: string[]) => void;
}

/** Checkboxes with a button that selects all or none. */
function CheckList({ legend, items, selected, isDisabled = false, onChange }: CheckListProps) {
  const isAll = items.every((item) => selected.includes(item));
  return (
    <fieldset class="check-list" disabled={isDisabled}>
      <legend>{legend}</legend>
      {items.map((item) => (
        <label key={item}>
          <input
            type="checkbox"
            checked={selected.includes(item)}
            onChange={() => onChange(items.filter((each) => selected.includes(each) !== (each === item)))}
          />
          {item}
        </label>
      ))}
      {items.length > 1 && (
        <button type="button" onClick={() => onChange(isAll ? [] : [...items])}>
          {isAll ? "None" : "All"}
        </button>
      )}
    </fieldset>
  );
}

function PlanReport({ plan, problem }: { plan: RenderPlanBody | Error | null; problem: string | null }) {
  if (problem !== null) return <p role="alert">{problem}</p>;
  if (plan === null) return <p role="status">Checking…</p>;
  if (plan instanceof Error) return <p role="alert">{plan.message}</p>;
  return (
    <div role="status" aria-label="Result">
      <p>{namesText(plan.file_names, plan.total)}</p>
      {plan.bakes.map((rebake) => (
        <p key={rebake.id}>
          Bakes this size first: <PlanText plan={rebake} />
        </p>
      ))}
      {plan.warnings.map((warning) => (
        <p key={warning}>{warning}</p>
      ))}
    </div>
  );
}

function RenderProgress() {
  const running = exporting.value;
  if (running === null) return null;
  return (
    <p class="render-progress" role="status">
      {exportText(running)}
      <progress max={1} value={running.baking ?? running.progress} aria-label={running.exportName} />
      <button disabled={running.stop === null} onClick={() => exporting.value?.stop?.()}>
        Stop
      </button>
    </p>
  );
}

function initialChoice(): BatchChoice {
  const saved = savedLooks.peek().map(({ name }) => name);
  return {
    hasCurrent: saved.length === 0,
    saved,
    views: [activeViewName.peek()],
    usesSavedViews: false,
    size: currentSize(),
    format: "png",
    hasSheet: false,
    fileName: "{scene}_{view}_{look}",
    start: 1,
    priority: 0,
  };
}

export function RenderDialog({ onClose }: { onClose: () => void }) {
  const dialog = useRef<HTMLDialogElement>(null);
  const sizeName = useId();
  const [choice, setChoice] = useState(initialChoice);
  const [sizeKind, setSizeKind] = useState<SizeKind>("baked");
  const [shown] = useState(() => look.peek());
  const [pose] = useState(currentPose);
  useEffect(() => dialog.current?.showModal(), []);
  const change = (changes: Partial<BatchChoice>) => setChoice((now) => ({ ...now, ...changes }));
  const { width, height } = activeView.value ?? { width: 640, height: 480 };
  const chooseSize = (kind: SizeKind) => {
    setSizeKind(kind);
    change({
      size: { baked: currentSize(), "4k": size4K(width, height), custom: choice.size ?? [width, height] }[kind],
    });
  };
  const problem = choiceProblem(choice);
  const id = bake.value;
  const request =
    problem !== null || id === null || shown === null
      ? null
      : batchRequest(choice, {
          bake: id,
          look: visibleLookOf(shown),
          activeView: activeViewName.value,
          pose,
          colorSpace: availableExrSpace.value,
        });
  const plan = useRenderPlan(request);
  const isReady = request !== null && plan !== null && !(plan instanceof Error) && exporting.value === null;
  const render = () => {
    if (!isReady) return;
    const light = choice.hasCurrent ? lightFilterText() : "";
    void renderAndSave("Render", batchFile(request, plan.total), request, light);
  };
  const [customWidth, customHeight] = choice.size ?? [width, height];
  const side = (label: string, value: number, set: (value: number) => readonly [number, number]) => (
    <label>
      {label}
      <input
        type="number"
        class="number"
        min={1}
        max={16384}
        value={Number.isFinite(value) ? value : ""}
        onInput={(event) => change({ size: set(event.currentTarget.valueAsNumber) })}
      />
    </label>
  );
  return (
    <dialog
      class="export-dialog"
      ref={dialog}
      aria-label="Render"
      onClose={onClose}
      onKeyDown={(event) => event.stopPropagation()}
    >
      <header class="panel-head">
        <h2>Render</h2>
        <IconButton icon="close" label="Close" onClick={() => dialog.current?.close()} />
      </header>
      <label>
        <input
          type="checkbox"
          checked={choice.hasCurrent}
          onChange={(event) => change({ hasCurrent: event.currentTarget.checked })}
        />
        Current look
      </label>
      {savedLooks.value.length > 0 && (
        <CheckList
          legend="Saved looks"
          items={savedLooks.value.map(({ name }) => name)}
          selected={choice.saved}
          onChange={(saved) => change({ saved })}
        />
      )}
      <CheckList
        legend="Views"
        items={views.value.map(({ name }) => name)}
        selected={choice.views}
        isDisabled={choice.usesSavedViews}
        onChange={(chosen) => change({ views: chosen })}
      />
      <label>
        <input
          type="checkbox"
          checked={choice.usesSavedViews}
          disabled={choice.saved.length === 0}
          onChange={(event) => change({ usesSavedViews: event.currentTarget.checked })}
        />
        Each saved look in its own view
      </label>
      <label for={sizeName}>Size</label>
      <select id={sizeName} value={sizeKind} onChange={(event) => chooseSize(event.currentTarget.value as SizeKind)}>
        <option value="baked">As shown, {`${width}×${height}`}</option>
        <option value="4k">4K, {size4K(width, height).join("×")}</option>
        <option value="custom">Custom</option>
      </select>
      {sizeKind === "custom" && (
        <div class="recipe-fields" role="group" aria-label="Custom size">
          {side("Width", customWidth, (value) => [value, customHeight])}
          {side("Height", customHeight, (value) => [customWidth, value])}
        </div>
      )}
      <h3>Format</h3>
      <RadioRow label="Format" choices={FORMATS} selected={choice.format} onSelect={(format) => change({ format })} />
      <label>
        <input
          type="checkbox"
          checked={choice.hasSheet && choice.format === "png"}
          disabled={choice.format !== "png"}
          onChange={(event) => change({ hasSheet: event.currentTarget.checked })}
        />
        Contact sheet
      </label>
      <label>
        File name
        <input
          type="text"
          value={choice.fileName}
          maxLength={200}
          title="Fields: {scene}, {view}, {look}, {bake}, {frame:04}"
          onInput={(event) => change({ fileName: event.currentTarget.value })}
        />
      </label>
      {choice.fileName.includes("{frame") && (
        <label>
          First number
          <input
            type="number"
            class="number"
            min={0}
            value={choice.start}
            onInput={(event) => change({ start: Math.max(0, Math.round(event.currentTarget.valueAsNumber || 0)) })}
          />
        </label>
      )}
      <h3>Priority</h3>
      <RadioRow
        label="Priority"
        choices={PRIORITIES}
        selected={String(choice.priority)}
        onSelect={(priority) => change({ priority: Number(priority) })}
      />
      <PlanReport plan={plan} problem={problem} />
      <RenderProgress />
      <button class="primary" disabled={!isReady} onClick={render}>
        Render
      </button>
    </dialog>
  );
}
