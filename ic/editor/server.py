"""The server that `met lsp` starts: an editor's questions on standard input, answers on standard output."""

from __future__ import annotations

import asyncio
import logging
import os
import sys
from collections.abc import Iterable, Sequence
from functools import partial
from typing import Any

from lsprotocol import types
from pygls.lsp.server import LanguageServer

from ic.editor.answers import AskedPosition, CannotRename
from ic.editor.checker_process import CheckerProcess
from ic.editor.checks import CheckedDeck, DeckChecks, OpenText
from ic.editor.diagnostics import QuickFix, actions, in_editor, quick_fixes
from ic.editor.lenses import FindLastRuns, lenses
from ic.editor.outline import folds, symbols
from ic.editor.positions import Texts, file_named, normal, path_of, uri_of
from ic.editor.semantic import LEGEND, semantic_tokens
from ic.text.files import DECK_IN_MEMORY
from met.diagnostic import Problem
from met.host.files import real_path
from met.version import VERSION

PYGLS_LOG = "pygls.protocol.json_rpc"
"""The logger to which pygls writes each error answer, with its traceback."""

OPTIONS = ("includeDirs", "defines", "helpInMessage")
"""The keys that an editor may give in its `initializationOptions`."""


BEGINNING = types.Position(0, 0)


def _is_no_refusal(record: logging.LogRecord) -> bool:
    """True except for an answer that refuses a name, which is not a fault of the server's and belongs in no log."""
    return record.exc_info is None or not isinstance(record.exc_info[1], CannotRename)


class DeckServer(LanguageServer):
    """A language server with its knowledge of decks."""

    def __init__(self, include_dirs: Iterable[str], defines: Iterable[str], last_runs: FindLastRuns | None) -> None:
        """include_dirs, defines: as of `-I` and `-D`; last_runs: reads archives, for lenses"""
        super().__init__("met", VERSION, text_document_sync_kind=types.TextDocumentSyncKind.Full)
        self.process = CheckerProcess()
        self.checks = DeckChecks(
            self.process,
            self.publish,
            self.log,
            self.refresh,
            include_dirs=[os.path.abspath(include_dir) for include_dir in include_dirs],
            defines=defines,
        )
        self._last_runs = last_runs
        self.related = True
        self._refreshes_colours = self._refreshes_lenses = False
        self.fixes: dict[str, list[QuickFix]] = {}
        self._published: dict[str, types.PublishDiagnosticsParams] = {}
        self._worker: asyncio.Task[None] | None = None

    def begin(self, parameters: types.InitializeParams) -> None:
        """Take the editor's options, and start to check."""
        support = parameters.capabilities.text_document and parameters.capabilities.text_document.publish_diagnostics
        self.related = bool(support and support.related_information)
        drawn = parameters.capabilities.workspace
        self._refreshes_colours = bool(drawn and drawn.semantic_tokens and drawn.semantic_tokens.refresh_support)
        self._refreshes_lenses = bool(drawn and drawn.code_lens and drawn.code_lens.refresh_support)
        self._take_options(parameters.initialization_options)
        self.process.start()
        if self._worker is None:  # an editor may begin twice: two workers would wait for each other's checks
            self._worker = asyncio.create_task(self.checks.work())

    def _take_options(self, settings: Any) -> None:
        """Take the editor's options, and warn of those that there are not or that are of a wrong type."""
        options = settings if isinstance(settings, dict) else {}
        for name in options.keys() - set(OPTIONS):
            self._warn(f"no option `{name}`; there are: {', '.join(OPTIONS)}")
        for name in ("includeDirs", "defines"):
            words = options.get(name, [])
            if not isinstance(words, list) or not all(isinstance(word, str) for word in words):
                self._warn(f"the option `{name}` is a list of texts")
            elif name == "defines":
                self.checks.defines = (*self.checks.defines, *words)
            else:
                self.checks.include_dirs = (*self.checks.include_dirs, *map(os.path.abspath, words))
        if options.get("helpInMessage"):
            self.related = False

    def _warn(self, text: str) -> None:
        self.window_show_message(types.ShowMessageParams(types.MessageType.Warning, f"met lsp: {text}"))

    def log(self, text: str) -> None:
        """Write an error into the editor's log."""
        self.window_log_message(types.LogMessageParams(types.MessageType.Error, f"met lsp: {text}"))

    def refresh(self) -> None:
        """Ask the editor to refresh colours and lenses, if it supports that: other files of a deck have changed."""
        if self._refreshes_colours:
            self.workspace_semantic_tokens_refresh(None)
        if self._refreshes_lenses:
            self.workspace_code_lens_refresh(None)

    def forget_notifications(self) -> None:
        """Release finished notifications: pygls keeps a future for each change of a text, as for an open request, a
        kilobyte each."""
        waiting = self.protocol._request_futures
        for number in [number for number, future in waiting.items() if future.done()]:
            del waiting[number]

    def end(self) -> None:
        """End the checking process."""
        if self._worker is not None:
            self._worker.cancel()
        self.process.close()

    def address(self, deck: CheckedDeck, name: str) -> str | None:
        """The address of a file that a deck's places name, as the editor writes it where it has the file open."""
        if name == deck.name:
            return deck.deck.uri
        path = file_named(name, deck.folder)
        if path is None:
            return None
        real = real_path(path)
        return next((text.uri for text in self.checks.texts.values() if text.identity == real), uri_of(path))

    def _as_checked(self, deck: CheckedDeck, uri: str) -> bool:
        """True where a text is the same as when the deck was checked."""
        return deck.texts.get(uri) == self.checks.texts.get(uri)

    def unchanged(self, deck: CheckedDeck) -> bool:
        """True where all texts of a deck are the same as when it was checked."""
        return all(
            self._as_checked(deck, uri) for uri, text in self.checks.texts.items() if text.identity in deck.files
        )

    def layout(self, uri: str) -> list[types.TextEdit]:
        """The edit that formats a text as `met fmt` does; none where it is formatted, or broken, which is logged."""
        from ic.formatting.files import lay_out_text

        opened = self.checks.texts.get(uri)
        if opened is None:
            return []
        before = normal(opened.text)
        try:
            after = lay_out_text(opened.path or DECK_IN_MEMORY, before)
        except Problem as problem:
            self._warn(f"not laid out: {problem.diagnostics[0].message}")
            return []
        if after == opened.text:
            return []
        lines = before.split("\n")
        end = types.Position(len(lines) - 1, self.workspace.position_codec.client_num_units(lines[-1]))
        return [types.TextEdit(types.Range(types.Position(0, 0), end), after)]

    def folders(self) -> list[str]:
        """The paths of the folders that the editor has open."""
        addresses = list(self.workspace.folders) or [self.workspace.root_uri or ""]
        return [path for path in map(path_of, addresses) if path is not None]

    def lenses(self, uri: str) -> list[types.CodeLens]:
        """The lines above the runs of a text, with data from archives beside its file."""
        asked, path = self.in_text(uri), path_of(uri)
        known = self._last_runs(path) if self._last_runs is not None and path is not None else {}
        return list(
            lenses(
                asked.text, asked.index, path, known, lambda *ends: types.Range(*(asked.position(end) for end in ends))
            )
        )

    def asked_position(self, parameters: types.TextDocumentPositionParams | Any) -> AskedPosition:
        """The position that a request is about."""
        return self.in_text(parameters.text_document.uri, parameters.position)

    def in_text(self, uri: str, position: types.Position = BEGINNING) -> AskedPosition:
        """A position of a text."""
        return AskedPosition(self.checks, self.workspace.position_codec, self.address, uri, position)

    def publish(self, decks: Iterable[CheckedDeck]) -> None:
        """Send the editor the diagnostics of each file whose diagnostics have changed."""
        by_file: dict[str, list[types.Diagnostic]] = {}
        versions: dict[str, int | None] = {}
        self.fixes = {}
        for deck in decks:
            texts = Texts(deck.reply.sources, self.workspace.position_codec)
            versions |= {uri: text.version for uri, text in deck.texts.items()}
            address = partial(self.address, deck)
            for diagnostic, edits in zip(deck.reply.diagnostics, deck.reply.edits, strict=True):
                uri, shown_diagnostic = in_editor(diagnostic, deck.name, texts, address, self.related)
                diagnostics = by_file.setdefault(uri, [])
                if shown_diagnostic in diagnostics:
                    continue
                diagnostics.append(shown_diagnostic)
                fixes = quick_fixes(diagnostic, edits, shown_diagnostic, texts, address)
                self.fixes.setdefault(uri, []).extend(fix for fix in fixes if self._as_checked(deck, fix.file))
        for uri in {**self._published, **dict.fromkeys(self.checks.texts), **by_file}:
            publication = types.PublishDiagnosticsParams(uri, by_file.get(uri, []), versions.get(uri))
            if self._published.get(uri) != publication:
                self.text_document_publish_diagnostics(publication)
                self._published[uri] = publication
        for uri in [uri for uri, published in self._published.items() if not published.diagnostics]:
            if uri not in self.checks.texts:
                del self._published[uri]


def make(
    include_dirs: Sequence[str] = (), defines: Sequence[str] = (), last_runs: FindLastRuns | None = None
) -> DeckServer:
    """A server with handlers for all its requests."""
    server = DeckServer(include_dirs, defines, last_runs)

    @server.feature(types.INITIALIZE)
    def initialize(parameters: types.InitializeParams) -> None:
        server.begin(parameters)

    @server.feature(types.TEXT_DOCUMENT_DID_OPEN)
    def did_open(parameters: types.DidOpenTextDocumentParams) -> None:
        document = parameters.text_document
        server.checks.open(OpenText(document.uri, document.text, document.version))

    @server.feature(types.TEXT_DOCUMENT_DID_CHANGE)
    def did_change(parameters: types.DidChangeTextDocumentParams) -> None:
        document = parameters.text_document
        text = server.workspace.get_text_document(document.uri).source
        server.forget_notifications()
        server.checks.change(OpenText(document.uri, text, document.version))

    @server.feature(types.TEXT_DOCUMENT_DID_SAVE)
    def did_save(parameters: types.DidSaveTextDocumentParams) -> None:
        server.checks.all_changed()

    @server.feature(types.WORKSPACE_DID_CHANGE_WATCHED_FILES)
    def did_change_files(parameters: types.DidChangeWatchedFilesParams) -> None:
        server.checks.all_changed()

    @server.feature(types.TEXT_DOCUMENT_DID_CLOSE)
    def did_close(parameters: types.DidCloseTextDocumentParams) -> None:
        server.checks.shut(parameters.text_document.uri)

    @server.feature(
        types.TEXT_DOCUMENT_CODE_ACTION, types.CodeActionOptions(code_action_kinds=[types.CodeActionKind.QuickFix])
    )
    def code_action(parameters: types.CodeActionParams) -> list[types.CodeAction]:
        uri, wanted = parameters.text_document.uri, parameters.context.only
        deck = server.checks.deck_of(uri)
        if deck is None or not server.unchanged(deck) or (wanted and types.CodeActionKind.QuickFix not in wanted):
            return []
        return actions(server.fixes.get(uri, ()), parameters.range)

    @server.feature(types.TEXT_DOCUMENT_FORMATTING)
    def formatting(parameters: types.DocumentFormattingParams) -> list[types.TextEdit]:
        return server.layout(parameters.text_document.uri)

    @server.feature(types.TEXT_DOCUMENT_DOCUMENT_SYMBOL)
    def document_symbol(parameters: types.DocumentSymbolParams) -> list[types.DocumentSymbol]:
        asked = server.in_text(parameters.text_document.uri)
        return symbols(asked.text, asked.position)

    @server.feature(types.TEXT_DOCUMENT_FOLDING_RANGE)
    def folding_range(parameters: types.FoldingRangeParams) -> list[types.FoldingRange]:
        return folds(server.in_text(parameters.text_document.uri).text)

    @server.feature(
        types.TEXT_DOCUMENT_COMPLETION, types.CompletionOptions(trigger_characters=[".", "<", '"', "#", "="])
    )
    def complete(parameters: types.CompletionParams) -> list[types.CompletionItem]:
        return server.asked_position(parameters).complete()

    @server.feature(types.TEXT_DOCUMENT_HOVER)
    def hover(parameters: types.HoverParams) -> types.Hover | None:
        return server.asked_position(parameters).hover()

    @server.feature(types.TEXT_DOCUMENT_DEFINITION)
    def definition(parameters: types.DefinitionParams) -> list[types.Location]:
        return server.asked_position(parameters).definitions()

    @server.feature(types.TEXT_DOCUMENT_REFERENCES)
    def references(parameters: types.ReferenceParams) -> list[types.Location]:
        return server.asked_position(parameters).references(parameters.context.include_declaration)

    @server.feature(types.TEXT_DOCUMENT_CODE_LENS)
    def code_lens(parameters: types.CodeLensParams) -> list[types.CodeLens]:
        return server.lenses(parameters.text_document.uri)

    @server.feature(types.TEXT_DOCUMENT_PREPARE_RENAME)
    def prepare_rename(parameters: types.PrepareRenameParams) -> types.PrepareRenamePlaceholder | None:
        return server.asked_position(parameters).nameable()

    @server.feature(types.TEXT_DOCUMENT_RENAME, types.RenameOptions(prepare_provider=True))
    async def renamed(parameters: types.RenameParams) -> types.WorkspaceEdit:
        await server.checks.rest()
        return await server.asked_position(parameters).rename(parameters.new_name, server.folders(), server.process)

    @server.feature(types.TEXT_DOCUMENT_SEMANTIC_TOKENS_FULL, LEGEND)
    def words(parameters: types.SemanticTokensParams) -> types.SemanticTokens:
        asked = server.in_text(parameters.text_document.uri)
        units = server.workspace.position_codec.client_num_units
        return semantic_tokens(asked.text, asked.names, asked.position, units)

    @server.feature("met/settled")
    async def settled(parameters: None) -> bool:
        """An answer after all changes from the editor are checked, and reported."""
        await server.checks.rest()
        return True

    @server.feature(types.SHUTDOWN)
    def shutdown(parameters: None) -> None:
        server.end()

    return server


def serve(include_dirs: Sequence[str] = (), defines: Sequence[str] = (), last_runs: FindLastRuns | None = None) -> None:
    """Serve an editor until it ends the session, or has gone. last_runs: reads archives, for lenses"""
    if sys.stdin is None:  # closed by whoever started it: there is no editor
        return
    server = make(include_dirs, defines, last_runs)
    logging.getLogger(PYGLS_LOG).addFilter(_is_no_refusal)
    out = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # output of any code must not get into the protocol
    try:
        server.start_io(stdout=out)
    finally:
        server.end()
