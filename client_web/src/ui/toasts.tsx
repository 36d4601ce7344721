/** Short messages in words, announced to screen readers; errors stay until they are closed, or what they say is mended. */
import { signal } from "@preact/signals";
import { useRef } from "preact/hooks";
import { UnansweredError } from "../net/api";
import { useReturnFocus } from "./keepFocus";

/** What an error is about: the next success there takes it away. */
type Topic = "server" | "files" | "edit";

interface Toast {
  id: number;
  kind: "note" | "error";
  text: string;
  topic?: Topic;
  action?: { label: string; run(): void };
}

const toasts = signal<Toast[]>([]);
let nextId = 1;
const NOTE_MS = 5000;
/** Long messages are read more slowly. */
const NOTE_MS_A_CHARACTER = 60;
const MAX_SHOWN = 3;

/** What is on the screen, in words. */
export const shownWords = (): string[] => toasts.peek().map(({ text }) => text);

function dismiss(id: number): void {
  toasts.value = toasts.value.filter((toast) => toast.id !== id);
}

function show(toast: Omit<Toast, "id">): void {
  const id = nextId++;
  const others = toasts.value.filter((other) => other.text !== toast.text);
  toasts.value = [...others, { ...toast, id }].slice(-MAX_SHOWN);
  if (toast.kind === "note") window.setTimeout(() => dismiss(id), Math.max(NOTE_MS, NOTE_MS_A_CHARACTER * toast.text.length));
}

export function note(text: string, action?: Toast["action"]): void {
  show({ kind: "note", text, ...(action ? { action } : {}) });
}

export function showError(error: unknown, topic?: Topic): void {
  const about = error instanceof UnansweredError ? "server" : topic;
  const text = error instanceof Error ? error.message : String(error);
  show({ kind: "error", text, ...(about ? { topic: about } : {}) });
}

/** What errors of a topic said no longer holds. */
export function mended(topic: Topic): void {
  if (toasts.peek().some((toast) => toast.topic === topic)) toasts.value = toasts.value.filter((toast) => toast.topic !== topic);
}

/** Run something that may fail, and say so where it does; where it succeeds, what was wrong with its topic is mended. */
export async function attempt<T>(work: () => Promise<T>, topic?: Topic): Promise<T | undefined> {
  try {
    const result = await work();
    mended("server");
    if (topic !== undefined) mended(topic);
    return result;
  } catch (error) {
    showError(error, topic);
    return undefined;
  }
}

function Message({ toast: { id, kind, text, action } }: { toast: Toast }) {
  const element = useRef<HTMLDivElement>(null);
  useReturnFocus(element);
  return (
    <div ref={element} class={`toast ${kind}`}>
      <span>{text}</span>
      {action && (
        <button
          onClick={() => {
            action.run();
            dismiss(id);
          }}
        >
          {action.label}
        </button>
      )}
      <button class="icon" aria-label="Close this message" onClick={() => dismiss(id)}>
        ×
      </button>
    </div>
  );
}

export function Toasts() {
  return (
    <div class="toasts" role="status" aria-live="polite">
      {toasts.value.map((toast) => (
        <Message key={toast.id} toast={toast} />
      ))}
    </div>
  );
}
