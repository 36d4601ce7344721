/** Short messages in words, announced to screen readers; errors stay until they are closed. */
import { signal } from "@preact/signals";

interface Toast {
  id: number;
  kind: "note" | "error";
  text: string;
  action?: { label: string; run(): void };
}

const toasts = signal<Toast[]>([]);
let nextId = 1;
const NOTE_MS = 5000;
const MAX_SHOWN = 4;

function dismiss(id: number): void {
  toasts.value = toasts.value.filter((toast) => toast.id !== id);
}

function show(toast: Omit<Toast, "id">): void {
  const id = nextId++;
  const others = toasts.value.filter((other) => other.text !== toast.text);
  toasts.value = [...others, { ...toast, id }].slice(-MAX_SHOWN);
  if (toast.kind === "note") window.setTimeout(() => dismiss(id), NOTE_MS);
}

export function note(text: string, action?: Toast["action"]): void {
  show({ kind: "note", text, ...(action ? { action } : {}) });
}

export function showError(error: unknown): void {
  show({ kind: "error", text: error instanceof Error ? error.message : String(error) });
}

/** Run something that may fail, and say so where it does. */
export async function attempt<T>(work: () => Promise<T>): Promise<T | undefined> {
  try {
    return await work();
  } catch (error) {
    showError(error);
    return undefined;
  }
}

export function Toasts() {
  return (
    <div class="toasts" role="status" aria-live="polite">
      {toasts.value.map((toast) => (
        <div key={toast.id} class={`toast ${toast.kind}`}>
          <span>{toast.text}</span>
          {toast.action && (
            <button
              onClick={() => {
                toast.action?.run();
                dismiss(toast.id);
              }}
            >
              {toast.action.label}
            </button>
          )}
          <button class="icon" aria-label="Close this message" onClick={() => dismiss(toast.id)}>
            ×
          </button>
        </div>
      ))}
    </div>
  );
}
