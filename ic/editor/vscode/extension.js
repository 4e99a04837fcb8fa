// The client of `met lsp` for VS Code: what the editor asks goes to the server, what the server says goes to the editor.
// It needs no other package: the protocol is JSON behind a header, and the editor's interface is `vscode`.
'use strict';

const vscode = require('vscode');
const { spawn } = require('child_process');

const MOST_STARTS = 5; // of a server that dies again and again

/** A server that runs: requests and their answers, by the Language Server Protocol on its standard input and output. */
class Connection {
  constructor(command, args, cwd, handlers) {
    this.waiting = new Map();
    this.handlers = handlers;
    this.number = 0;
    this.buffer = Buffer.alloc(0);
    this.process = spawn(command, args, { cwd, stdio: ['pipe', 'pipe', 'pipe'] });
    this.process.stdout.on('data', (data) => this.take(data));
    this.process.stderr.on('data', (data) => handlers.log(data.toString()));
    this.process.stdin.on('error', () => {});
    this.process.on('error', (error) => this.end(error));
    this.process.on('exit', (code) => this.end(new Error(`the server has ended, status ${code}`)));
  }

  send(message) {
    if (this.ended) return;
    const data = Buffer.from(JSON.stringify({ jsonrpc: '2.0', ...message }));
    this.process.stdin.write(`Content-Length: ${data.length}\r\n\r\n`);
    this.process.stdin.write(data);
  }

  tell(method, params) {
    this.send({ method, params });
  }

  /** The answer to a request; it fails where the server refuses it, or the editor wants it no more. */
  ask(method, params, token) {
    if (this.ended) return Promise.reject(this.ended);
    const id = ++this.number;
    return new Promise((resolve, reject) => {
      this.waiting.set(id, { resolve, reject });
      if (token) token.onCancellationRequested(() => this.tell('$/cancelRequest', { id }));
      this.send({ id, method, params });
    });
  }

  take(data) {
    this.buffer = Buffer.concat([this.buffer, data]);
    for (;;) {
      const end = this.buffer.indexOf('\r\n\r\n');
      if (end < 0) return;
      const length = Number(/Content-Length: *(\d+)/i.exec(this.buffer.toString('ascii', 0, end))[1]);
      if (this.buffer.length < end + 4 + length) return;
      const text = this.buffer.toString('utf8', end + 4, end + 4 + length);
      this.buffer = this.buffer.subarray(end + 4 + length);
      this.received(JSON.parse(text));
    }
  }

  received(message) {
    if (message.method === undefined) {
      const asked = this.waiting.get(message.id);
      this.waiting.delete(message.id);
      if (asked && message.error) asked.reject(new Error(message.error.message));
      else if (asked) asked.resolve(message.result);
      return;
    }
    const handler = this.handlers[message.method];
    if (handler) handler(message.params);
    if (message.id !== undefined) this.send({ id: message.id, result: null });
  }

  end(reason) {
    if (this.ended) return;
    this.ended = reason;
    for (const asked of this.waiting.values()) asked.reject(reason);
    this.waiting.clear();
    this.handlers.ended(reason);
  }

  stop() {
    this.handlers = { log() {}, ended() {} };
    this.ask('shutdown', null).then(() => this.tell('exit', null), () => {});
    setTimeout(() => this.process.kill(), 2000).unref();
  }
}

// what the editor has, as the protocol has it, and back

const position = (at) => ({ line: at.line, character: at.character });
const range = (r) => ({ start: position(r.start), end: position(r.end) });
const toRange = (r) => new vscode.Range(r.start.line, r.start.character, r.end.line, r.end.character);
const toUri = (text) => vscode.Uri.parse(text, true);
const toLocation = (l) => new vscode.Location(toUri(l.uri), toRange(l.range));
const toEdit = (e) => new vscode.TextEdit(toRange(e.range), e.newText);
const named = (document) => ({ uri: document.uri.toString() });
const folderOf = (folders) => (folders.length ? folders[0].uri.fsPath : undefined);

function toDiagnostic(given) {
  const made = new vscode.Diagnostic(toRange(given.range), given.message, (given.severity || 1) - 1);
  made.code = given.code;
  made.source = given.source;
  made.relatedInformation = (given.relatedInformation || []).map(
    (each) => new vscode.DiagnosticRelatedInformation(toLocation(each.location), each.message),
  );
  return made;
}

function toWorkspaceEdit(given) {
  const made = new vscode.WorkspaceEdit();
  for (const [uri, edits] of Object.entries(given.changes || {})) made.set(toUri(uri), edits.map(toEdit));
  return made;
}

function toSymbol(given) {
  const made = new vscode.DocumentSymbol(
    given.name, given.detail || '', given.kind - 1, toRange(given.range), toRange(given.selectionRange),
  );
  made.children = (given.children || []).map(toSymbol);
  return made;
}

function toCompletion(given) {
  const made = new vscode.CompletionItem(given.label, given.kind ? given.kind - 1 : undefined);
  made.detail = given.detail;
  made.sortText = given.sortText;
  return made;
}

/** The extension: one server, started anew where it has died, and what is known of the open decks. */
class Met {
  constructor(context) {
    this.context = context;
    this.log = vscode.window.createOutputChannel('MET');
    this.diagnostics = vscode.languages.createDiagnosticCollection('met');
    this.starts = 0;
    this.ready = Promise.resolve();
    this.coloursChanged = new vscode.EventEmitter();
    this.lensesChanged = new vscode.EventEmitter();
  }

  start() {
    const settings = vscode.workspace.getConfiguration('met');
    const folders = vscode.workspace.workspaceFolders || [];
    const handlers = {
      log: (text) => this.log.append(text),
      ended: (reason) => this.died(reason),
      'textDocument/publishDiagnostics': (given) =>
        this.diagnostics.set(toUri(given.uri), given.diagnostics.map(toDiagnostic)),
      'workspace/semanticTokens/refresh': () => this.coloursChanged.fire(),
      'workspace/codeLens/refresh': () => this.lensesChanged.fire(),
      'window/logMessage': (given) => this.log.appendLine(given.message),
      'window/showMessage': (given) => vscode.window.showWarningMessage(given.message),
    };
    this.connection = new Connection(settings.get('command') || 'met', ['lsp', '--stdio'], folderOf(folders), handlers);
    const capabilities = {
      general: { positionEncodings: ['utf-16'] },
      textDocument: {
        publishDiagnostics: { relatedInformation: true, versionSupport: true },
        rename: { prepareSupport: true },
      },
      workspace: {
        workspaceFolders: true,
        didChangeWatchedFiles: { dynamicRegistration: false },
        semanticTokens: { refreshSupport: true },
        codeLens: { refreshSupport: true },
      },
    };
    const connection = this.connection;
    this.ready = connection
      .ask('initialize', {
        processId: process.pid,
        rootUri: folders.length ? folders[0].uri.toString() : null,
        workspaceFolders: folders.map((each) => ({ uri: each.uri.toString(), name: each.name })),
        capabilities,
        initializationOptions: { includeDirs: settings.get('includeDirs'), defines: settings.get('defines') },
      })
      .then((answer) => {
        connection.tell('initialized', {});
        for (const document of vscode.workspace.textDocuments) this.opened(document);
        const legend = answer.capabilities.semanticTokensProvider;
        if (legend && !this.legend) this.colour(legend.legend);
      });
    this.ready.catch(() => {});
  }

  died(reason) {
    this.diagnostics.clear();
    this.log.appendLine(String(reason));
    this.starts += 1;
    if (reason.code === 'ENOENT') {
      vscode.window.showErrorMessage('`met` was not found: set `met.command` to where it is.');
    } else if (this.starts < MOST_STARTS) {
      setTimeout(() => this.start(), 1000 * this.starts).unref();
    } else {
      vscode.window.showErrorMessage(`MET: the language server has died ${this.starts} times; its log says why.`);
    }
  }

  restart() {
    this.connection.stop();
    this.diagnostics.clear();
    this.starts = 0;
    this.start();
  }

  async ask(method, document, more, token) {
    await this.ready;
    return this.connection.ask(`textDocument/${method}`, { textDocument: named(document), ...more }, token);
  }

  /** An answer that an editor can do without: where there is none, the log has the reason. */
  async wish(method, document, more, token) {
    try {
      return await this.ask(method, document, more, token);
    } catch (error) {
      this.log.appendLine(`${method}: ${error.message}`);
      return null;
    }
  }

  opened(document) {
    if (document.languageId !== 'met') return;
    const { languageId, version } = document;
    const text = document.getText();
    this.connection.tell('textDocument/didOpen', { textDocument: { ...named(document), languageId, version, text } });
  }

  tellOf(document, method, more) {
    if (document.languageId !== 'met') return;
    this.ready.then(() => this.connection.tell(`textDocument/${method}`, more), () => {});
  }

  watch() {
    const { workspace } = vscode;
    const files = workspace.createFileSystemWatcher('**/*.{ic,csv,urdf}');
    const archives = workspace.createFileSystemWatcher('**/*.run.json'); // written when a run has ended
    const ended = () => this.lensesChanged.fire();
    const changed = (type) => (uri) =>
      this.connection.tell('workspace/didChangeWatchedFiles', { changes: [{ uri: uri.toString(), type }] });
    this.context.subscriptions.push(
      workspace.onDidOpenTextDocument((document) => this.ready.then(() => this.opened(document), () => {})),
      workspace.onDidCloseTextDocument((document) =>
        this.tellOf(document, 'didClose', { textDocument: named(document) })),
      workspace.onDidSaveTextDocument((document) =>
        this.tellOf(document, 'didSave', { textDocument: named(document) })),
      workspace.onDidChangeTextDocument(({ document }) =>
        this.tellOf(document, 'didChange', {
          textDocument: { ...named(document), version: document.version },
          contentChanges: [{ text: document.getText() }],
        })),
      files, files.onDidCreate(changed(1)), files.onDidChange(changed(2)), files.onDidDelete(changed(3)),
      archives, archives.onDidCreate(ended), archives.onDidChange(ended), archives.onDidDelete(ended),
    );
  }

  provide() {
    const { languages } = vscode;
    const at = (place) => ({ position: position(place) });
    const locations = (found) => (found || []).map(toLocation);
    const add = (kind, provider, ...more) =>
      this.context.subscriptions.push(languages[`register${kind}Provider`]({ language: 'met' }, provider, ...more));
    add('CompletionItem', {
      provideCompletionItems: async (document, place, token) =>
        ((await this.wish('completion', document, at(place), token)) || []).map(toCompletion),
    }, '.', '<', '"', '#', '=');
    add('Hover', {
      provideHover: async (document, place, token) => {
        const found = await this.wish('hover', document, at(place), token);
        return found && new vscode.Hover(new vscode.MarkdownString(found.contents.value), toRange(found.range));
      },
    });
    add('Definition', {
      provideDefinition: async (document, place, token) =>
        locations(await this.wish('definition', document, at(place), token)),
    });
    add('Reference', {
      provideReferences: async (document, place, { includeDeclaration }, token) =>
        locations(await this.wish('references', document, { ...at(place), context: { includeDeclaration } }, token)),
    });
    add('CodeLens', {
      onDidChangeCodeLenses: this.lensesChanged.event,
      provideCodeLenses: async (document, token) =>
        ((await this.wish('codeLens', document, {}, token)) || []).map(
          (each) => new vscode.CodeLens(toRange(each.range), each.command),
        ),
    });
    add('Rename', {
      prepareRename: async (document, place, token) => {
        const found = await this.ask('prepareRename', document, at(place), token);
        if (!found) throw new Error('there is no name here');
        return { range: toRange(found.range), placeholder: found.placeholder };
      },
      provideRenameEdits: async (document, place, newName, token) =>
        toWorkspaceEdit(await this.ask('rename', document, { ...at(place), newName }, token)),
    });
    add('DocumentSymbol', {
      provideDocumentSymbols: async (document, token) =>
        ((await this.wish('documentSymbol', document, {}, token)) || []).map(toSymbol),
    });
    add('FoldingRange', {
      provideFoldingRanges: async (document, context, token) =>
        ((await this.wish('foldingRange', document, {}, token)) || []).map(
          (each) => new vscode.FoldingRange(each.startLine, each.endLine),
        ),
    });
    add('DocumentFormattingEdit', {
      provideDocumentFormattingEdits: async (document, options, token) =>
        ((await this.wish('formatting', document, { options: { tabSize: 4, insertSpaces: true } }, token)) || [])
          .map(toEdit),
    });
    add('CodeActions', {
      provideCodeActions: async (document, where, context, token) => {
        const asked = { range: range(where), context: { diagnostics: [] } };
        return ((await this.wish('codeAction', document, asked, token)) || []).map((each) => {
          const made = new vscode.CodeAction(each.title, vscode.CodeActionKind.QuickFix);
          made.edit = toWorkspaceEdit(each.edit);
          made.isPreferred = each.isPreferred;
          made.diagnostics = (each.diagnostics || []).map(toDiagnostic);
          return made;
        });
      },
    });
  }

  colour(legend) {
    this.legend = new vscode.SemanticTokensLegend(legend.tokenTypes, legend.tokenModifiers);
    const provider = {
      onDidChangeSemanticTokens: this.coloursChanged.event,
      provideDocumentSemanticTokens: async (document, token) => {
        const found = await this.wish('semanticTokens/full', document, {}, token);
        return found && new vscode.SemanticTokens(new Uint32Array(found.data));
      },
    };
    this.context.subscriptions.push(
      vscode.languages.registerDocumentSemanticTokensProvider({ language: 'met' }, provider, this.legend),
    );
  }

  /** Run words of `met` as a task: in a terminal, whose output stays when they have ended. */
  terminal(words) {
    const folders = vscode.workspace.workspaceFolders || [];
    const command = vscode.workspace.getConfiguration('met').get('command') || 'met';
    const task = new vscode.Task(
      { type: 'process' }, folders.length ? vscode.TaskScope.Workspace : vscode.TaskScope.Global,
      words.join(' '), 'met', new vscode.ProcessExecution(command, words, { cwd: folderOf(folders) }), [],
    );
    task.presentationOptions = { reveal: vscode.TaskRevealKind.Always, focus: true };
    vscode.tasks.executeTask(task);
  }

  run() {
    const editor = vscode.window.activeTextEditor;
    if (!editor || editor.document.languageId !== 'met' || editor.document.isUntitled) return;
    this.terminal(['run', editor.document.uri.fsPath]);
  }
}

let met;

exports.activate = (context) => {
  met = new Met(context);
  context.subscriptions.push(
    met.log, met.diagnostics,
    vscode.commands.registerCommand('met.run', () => met.run()),
    vscode.commands.registerCommand('met.terminal', (words) => met.terminal(words)),
    vscode.commands.registerCommand('met.restart', () => met.restart()),
  );
  met.start();
  met.watch();
  met.provide();
};

exports.deactivate = () => met && met.connection.stop();
