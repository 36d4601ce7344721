/** Toast messages, announced to screen readers; errors stay until closed or resolved. */
import { signal } from "@preact/signals";
import { useRef } from "preact/hooks";
import { UnreachableError } from "../session/net/api";
import { useReturnFocus } from "./restoreFocus";

/** Topic of an error: the next success on it removes the error. */
type ToastTopic = "server" | "files" | "edit";

interface Toast {
  id: number;
  kind: "note" | "error";
  text: string;
  topic?: ToastTopic;
  action?: { label: string; run: () => void };
}

const toasts = signal<Toast[]>([]);
let nextId = 1;
const NOTE_MS = 5000;
/** Long messages stay longer. */
const NOTE_MS_PER_CHARACTER = 60;
/** Of notes, and of errors: no note removes an error. */
const MAX_SHOWN = 3;

/** The visible texts. */
export const visibleTexts = (): string[] => toasts.peek().map(({ text }) => text);

function dismissToast(id: number): void {
  toasts.value = toasts.value.filter((toast) => toast.id !== id);
}

function addToast(toast: Omit<Toast, "id">): void {
  const id = nextId++;
  const remaining = toasts.value.filter((current) => current.text !== toast.text);
  const ofKind = remaining.filter(({ kind }) => kind === toast.kind);
  const removed = ofKind.slice(0, Math.max(0, ofKind.length + 1 - MAX_SHOWN));
  toasts.value = [...remaining.filter((current) => !removed.includes(current)), { ...toast, id }];
  if (toast.kind === "note")
    window.setTimeout(() => dismissToast(id), Math.max(NOTE_MS, NOTE_MS_PER_CHARACTER * toast.text.length));
}

export function showNote(text: string, action?: Toast["action"]): void {
  addToast({ kind: "note", text, ...(action ? { action } : {}) });
}

/** Show what reading a file has changed, in one note. */
export function showWarnings(warnings: readonly string[]): void {
  if (warnings.length > 0) showNote(warnings.join(" "));
}

export function showError(error: unknown, topic?: ToastTopic): void {
  const topicShown = error instanceof UnreachableError ? "server" : topic;
  const text = error instanceof Error ? error.message : String(error);
  addToast({ kind: "error", text, ...(topicShown ? { topic: topicShown } : {}) });
}

/** Remove the errors of a topic. */
export function clearErrors(topic: ToastTopic): void {
  if (toasts.peek().some((toast) => toast.topic === topic))
    toasts.value = toasts.value.filter((toast) => toast.topic !== topic);
}

/** Run an action and show its error; on success, remove errors of its topic. */
export async function reportErrors<T>(work: () => Promise<T>, topic?: ToastTopic): Promise<T | undefined> {
  try {
    const result = await work();
    clearErrors("server");
    if (topic !== undefined) clearErrors(topic);
    return result;
  } catch (error) {
    showError(error, topic);
    return undefined;
  }
}

function ToastMessage({ toast: { id, kind, text, action } }: { toast: Toast }) {
  const element = useRef<HTMLDivElement>(null);
  useReturnFocus(element);
  return (
    <div ref={element} class={`toast ${kind}`}>
      <span>{text}</span>
      {action && (
        <button
          onClick={() => {
            action.run();
            dismissToast(id);
          }}
        >
          {action.label}
        </button>
      )}
      <button class="icon" aria-label="Dismiss" onClick={() => dismissToast(id)}>
        ×
      </button>
    </div>
  );
}

export function Toasts() {
  return (
    <div class="toasts" role="status" aria-live="polite">
      {toasts.value.map((toast) => (
        <ToastMessage key={toast.id} toast={toast} />
      ))}
    </div>
  );
}
